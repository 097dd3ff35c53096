"""Run the one entry that a pull request changes: `make entered`, for the workflow."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

FOLDER = re.compile(r"entries/[a-z][a-z0-9_]{0,40}")


def changed() -> str:
    """Return the one folder of entries that the last commit brings, if it brings nothing else.

    In a workflow that is the merge of the pull request into main, as main stands by then. Its first
    parent is main.
    """
    command = ["git", "diff", "--name-only", "-z", "HEAD^1", "HEAD"]
    paths = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split("\0")
    folders = {"/".join(path.split("/")[:2]) for path in paths if path}
    if len(folders) != 1 or not FOLDER.fullmatch(*folders):
        sys.exit(
            "an entry's change is in one folder entries/NAME, of small letters, digits and _; "
            f"this is in {', '.join(sorted(folders)[:5]) or 'nothing'}"
        )
    return folders.pop()


def main() -> None:
    """Run it, and pack its result."""
    program = str(Path(sys.executable).with_name("smc-mujoco"))
    folder = changed()
    code = subprocess.run(
        [program, "enter", folder, "--results", "results"], check=False
    ).returncode
    if code:
        sys.exit(code)
    (result,) = Path("results").glob("*/*/result.json")
    shutil.make_archive(result.parent.name, "zip", result.parents[1])


if __name__ == "__main__":
    main()
