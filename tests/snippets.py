"""README's and the tutorial's scripts as files, for the type checkers of `make check`, which see
them as a user's do.

    python tests/snippets.py FOLDER    # readme_1.py, ..., the tutorial's files, settings

The parameters of laws and tests have no types in the pages, so only the other scripts get a strict
check.
"""

import json
import sys
from pathlib import Path

from helpers.pages import ROOT, blocks, titled

folder = Path(sys.argv[1])
folder.mkdir(parents=True, exist_ok=True)
for i, block in enumerate(blocks((ROOT / "README.md").read_text(), "python"), 1):
    (folder / f"readme_{i}.py").write_text(block)
for name, text in titled(ROOT / "docs" / "tutorial.md").items():
    (folder / name).write_text(text)
strict = ["readme_2.py", "compare.py"]
settings = {
    "typeCheckingMode": "standard",
    "strict": strict,
    "extraPaths": [str(ROOT)],
}
(folder / "pyrightconfig.json").write_text(json.dumps(settings))
