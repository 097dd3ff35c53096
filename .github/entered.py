"""Run the entry of a pull request, or of a name: `make entered`, for the workflows.

    BASE=COMMIT make entered                    # the one folder entries/NAME that differs from a commit
    NAME=soft_relay NUMBER=... make entered     # on hidden instances, too, if its law is checked

In a workflow (CI=true) the law runs without network, without a way to gain rights, and without the
environment, which has the workflow's tokens. A law whose file can do more than compute could read
the number in the environment of the processes around it. So where there is a number, it does not
run at all.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from smc_mujoco.benchmark import entry as entries

FOLDER = re.compile(r"entries/[a-z][a-z0-9_]{0,40}")
COMMIT = re.compile(r"[0-9a-f]{40}")
RESULTS = Path("results")


def changed(base: str) -> str:
    """Return the one folder of entries that differs from a commit, if nothing else does."""
    if not COMMIT.fullmatch(base):
        sys.exit(f"BASE is {base!r}: give a commit of 40 hex digits")
    paths = subprocess.run(
        ["git", "diff", "--name-only", "-z", base, "HEAD"],
        check=True,
        capture_output=True,
        text=True,
    ).stdout.split("\0")[:-1]
    return folder({"/".join(path.split("/")[:2]) for path in paths})


def folder(names: set[str]) -> str:
    """Return the only folder, if it is one of an entry."""
    if len(names) != 1 or not FOLDER.fullmatch(*names):
        told = ", ".join(sorted(names)[:5]) or "nothing"
        sys.exit(
            f"an entry's change is in one folder entries/NAME, of small letters, digits and _; this is in {told}"
        )
    return names.pop()


def alone(command: list[str]) -> list[str]:
    """Return a command that has no network, no way to gain rights, and nothing of the environment."""
    own = [f"--reuid={os.getuid()}", f"--regid={os.getgid()}", "--clear-groups", "--no-new-privs"]
    kept = [f"{name}={os.environ[name]}" for name in ("PATH", "HOME")]
    inside = ["setpriv", *own, "--", "env", "--ignore-environment", *kept, *command]
    return ["sudo", "--non-interactive", "unshare", "--net", "--", *inside]


def unread(place: str) -> str:
    """Return why nothing of an entry may run beside the number, from its files alone; "" if it may."""
    entry = entries.read(place)
    if entry.file is not None and entry.file.suffix != ".py":
        return f"{entry.file.name} is machine code, or becomes it"
    return entry.why_unread


def main() -> None:
    """Run it, on the visible instances first."""
    name, base, number = (os.environ.pop(key, "") for key in ("NAME", "BASE", "NUMBER"))
    if name:
        place = folder({f"entries/{name}"})
    else:
        place = changed(base)
    if number and (why := unread(place)):
        sys.exit(f"{place} runs on no hidden instances before their number is published: {why}")
    command = [
        str(Path(sys.executable).with_name("smc-mujoco")),
        "enter",
        place,
        "--results",
        str(RESULTS),
    ]
    runs = alone if os.environ.get("CI") else list
    if code := subprocess.run(runs(command), check=False).returncode:
        sys.exit(code)
    (result,) = RESULTS.glob("*/*/result.json")
    if number and json.loads(result.read_text(encoding="utf-8"))["checked"]:
        with tempfile.TemporaryDirectory() as secret:
            file = Path(secret, "number")
            file.write_text(number, encoding="ascii")
            if code := subprocess.run(
                runs([*command, "--hidden", str(file)]), check=False
            ).returncode:
                sys.exit(code)
    shutil.make_archive(result.parent.name, "zip", result.parents[1])


if __name__ == "__main__":
    main()
