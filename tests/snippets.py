"""README's scripts as files, for the type checkers of `make check`, which see them as a user's do.

    python tests/snippets.py FOLDER    # readme_1.py, ...; and pyright's settings: strict for the first

A law's parameters have no types in README, so only the script without a law passes a strict check.
"""

import json
import sys
from pathlib import Path

from helpers.pages import ROOT, blocks

folder = Path(sys.argv[1])
folder.mkdir(parents=True, exist_ok=True)
for i, block in enumerate(blocks((ROOT / "README.md").read_text(), "python"), 1):
    (folder / f"readme_{i}.py").write_text(block)
settings = {"typeCheckingMode": "standard", "strict": ["readme_1.py"], "extraPaths": [str(ROOT)]}
(folder / "pyrightconfig.json").write_text(json.dumps(settings))
