"""What users get: a wheel that holds models and scenes and works from any folder, and a set-up that
installs what the lock pins or fails in one sentence."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
CLEAN = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "PIP_"))}


def run(*command: object, cwd: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    words = [str(word) for word in command]
    return subprocess.run(words, cwd=cwd, env=CLEAN | variables, capture_output=True, text=True, check=False)


def shipped(*folders: str) -> set[str]:
    """The files under these folders of the project, relative to it."""
    files = (path for folder in folders for path in (ROOT / folder).rglob("*") if path.is_file())
    return {path.relative_to(ROOT).as_posix() for path in files if "__pycache__" not in path.parts}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    done = run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def binaries(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """bin of a new environment that has the wheel, and this environment's packages but not this checkout."""
    home = tmp_path_factory.mktemp("environment")
    venv.create(home)
    python = home / "bin" / "python"
    done = run(sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", wheel, cwd=home)
    assert done.returncode == 0, done.stderr
    (site,) = home.glob("lib/python*/site-packages")
    # a path named in a .pth file is added, the .pth files in it (the editable install) are not read
    (site / "packages.pth").write_text(str(Path(pytest.__file__).parents[1]))
    return python.parent


def test_the_wheel_holds_the_package_the_models_and_the_scenes_and_nothing_else(wheel):
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert names == shipped("smc_mujoco") | {f"smc_mujoco/{name}" for name in shipped("models", "scenes")}


def test_the_sdist_builds_the_same_wheel(wheel, tmp_path):
    done = run(sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", tmp_path, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    (archive,) = tmp_path.glob("*.tar.gz")
    shutil.unpack_archive(archive, tmp_path, filter="data")
    (source,) = (path for path in tmp_path.iterdir() if path.is_dir())
    done = run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path, cwd=source)
    assert done.returncode == 0, done.stderr
    again = zipfile.ZipFile(tmp_path / wheel.name)
    assert {i.filename: i.CRC for i in again.infolist()} == {
        i.filename: i.CRC for i in zipfile.ZipFile(wheel).infolist()
    }


def test_models_are_found_from_the_wheel(binaries, tmp_path):
    names = sorted(name.removeprefix("models/") for name in shipped("models"))
    code = "import sys; from smc_mujoco.plant import model_path as f; print(*map(f, sys.argv[1:]), sep='\\n')"
    done = run(binaries / "python", "-c", code, *names, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for name, path in zip(names, map(Path, done.stdout.splitlines()), strict=True):
        assert path.is_relative_to(binaries.parent)
        assert path.as_posix().endswith(f"smc_mujoco/models/{name}")


def test_a_scene_runs_from_the_wheel_in_any_folder(binaries, tmp_path):
    program, out = binaries / "smc-mujoco", tmp_path / "out"
    done = run(program, "run", "inverted_pendulum", "--no-video", "--out", out, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert list(tmp_path.iterdir()) == [out]
    assert any(path.is_file() for path in out.rglob("*"))


LAWS = """
import pytest
import smc_mujoco as smc
@pytest.mark.parametrize("phi", [0.3, 2.0])
def test_my_law_settles(step_response, phi):
    r = step_response("inverted_pendulum", smc.law("boundary_layer", k=6, c=8, phi=phi), step=0.2, duration=2.0)
    assert r.settling_time < 0.6 and r.overshoot < 20
"""


def test_a_user_s_test_passes_with_a_good_law_and_fails_readably_with_a_bad_one(binaries, tmp_path):
    (tmp_path / "test_law.py").write_text(LAWS)
    plain = {name: "" for name in CLEAN if name.startswith("PYTEST_")}
    options = ("-p", "no:cacheprovider", "-W", "error", "--smc-out=failed", "--strict-markers")
    done = run(binaries / "python", "-m", "pytest", *options, cwd=tmp_path, **plain)
    assert done.returncode == 1, done.stderr
    assert "1 failed, 1 passed" in done.stdout
    assert "FAILED test_law.py::test_my_law_settles[2.0] - assert (inf < 0.6" in done.stdout
    assert "inverted_pendulum under boundary_layer(k=6, c=8, phi=2), step 0.2 rad" in done.stdout
    assert re.findall(r"^(\S+) .*  (< \S+) +(\w+)$", done.stdout, re.MULTILINE) == [("settling_time", "< 0.6", "NO")]
    (figure,) = re.findall(r"^figure: (.*)$", done.stdout, re.MULTILINE)
    assert Path(figure).parent == tmp_path / "failed"
    assert Path(figure).stat().st_size > 1000


@pytest.mark.parametrize("name", ["requirements.lock", "requirements-bench.lock", "requirements-docs.lock"])
def test_a_lock_pins_every_package_by_hash_and_names_no_host(name):
    text = (ROOT / name).read_text()
    assert "://" not in text
    entries = re.split(r"^(?=\w)", text, flags=re.MULTILINE)[1:]
    pinned = re.compile(r"[a-z0-9.-]+==\S+ .*\\\n(    --hash=sha256:[0-9a-f]{64}( \\)?\n)+")
    assert [entry for entry in entries if not pinned.fullmatch(entry)] == []


def test_the_lock_has_every_dependency():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    groups = project["dependency-groups"]
    wanted = [*project["project"]["dependencies"], *groups["test"], *groups["check"]]
    names = {re.split(r"[^A-Za-z0-9.-]", line)[0].lower() for line in wanted}
    lock = (ROOT / "requirements.lock").read_text()
    assert names <= set(re.findall(r"^([a-z0-9.-]+)==", lock, re.MULTILINE))


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    for name in ("setup.sh", "pyproject.toml", "requirements.lock"):
        shutil.copy(ROOT / name, tmp_path)
    return tmp_path


def imposter(folder: Path, script: str) -> str:
    """A python3 that answers with a shell script."""
    path = folder / "python3"
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return str(path)


@pytest.mark.parametrize(
    ("script", "sentence"),
    [
        ("echo 3.8", "needs Python 3.11 or newer, but"),
        ("echo 2.7", "needs Python 3.11 or newer, but"),
        ("exit 127", "needs Python 3.11 or newer and cannot run"),
        ('case "$2" in *ensurepip*) exit 1;; esac; echo 3.11', "has no venv module"),
    ],
)
def test_set_up_without_a_fit_python_is_one_sentence(checkout, script, sentence):
    done = run("./setup.sh", cwd=checkout, PYTHON=imposter(checkout, script))
    assert done.returncode == 1
    assert done.stdout == ""
    assert sentence in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (checkout / ".venv").exists()


def test_set_up_without_network_is_one_sentence_and_is_taken_up_again(checkout):
    offline = {"PIP_INDEX_URL": "http://127.0.0.1:9", "PIP_CONFIG_FILE": os.devnull, "PIP_RETRIES": "1"}
    for _ in range(2):
        done = run("./setup.sh", cwd=checkout, PYTHON=sys.executable, **offline)
        assert done.returncode == 1
        assert done.stderr.startswith("smc-mujoco: no network: ")
        assert len(done.stderr.splitlines()) == 1
        assert "127.0.0.1" in (checkout / ".venv" / "setup.log").read_text()
