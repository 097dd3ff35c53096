"""Machine code on disk: loaded where it fits, compiled where it does not, never in the way."""

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest
from numba import types

import smc_mujoco as smc
from smc_mujoco.common import code_cache, files, jit
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.simulation import native

REAL = types.float64(types.float64)

# A process compiles functions from one factory; they get the same names, and numba's symbols their numbers in order.
COMPILES = """
import sys
from added import adds
from numba import types
from smc_mujoco.common.jit import compiled
for term in map(float, sys.argv[1:]):
    made = compiled(types.float64(types.float64), adds(term), cache=True)
    print(made.cache_hits, made.ctypes(1.0))
"""

KEYS = """
from {module} import keys_of_shipped
print(*keys_of_shipped(reverse=True))
"""


def python(code: str, *arguments: object, folder: Path) -> subprocess.Popen:
    """A new Python process that finds this package, the tests here and the modules in a folder."""
    places = [str(Path(smc.__file__).parents[1]), str(Path(__file__).parent), str(folder)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(places), "NUMBA_CACHE_DIR": str(folder)}
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True)


def said(process: subprocess.Popen) -> list[list[float]]:
    """The numbers that a process printed, by line."""
    out, _ = process.communicate(timeout=300)
    assert process.returncode == 0
    return [[float(word) for word in line.split()] for line in out.splitlines()]


@pytest.fixture
def adder(tmp_path):
    """A folder with the module `added`."""
    text = "def adds(term):\n    def added(x):\n        return x + term\n\n    return added\n"
    (tmp_path / "added.py").write_text(text)
    return tmp_path


@pytest.fixture
def cached(tmp_path, monkeypatch):
    """A folder that numba's settings name as the cache, empty."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    return tmp_path


def scaled(factor):
    """A function with a closed-over value."""

    def product(x):
        return factor * x

    return product


def stored(folder: Path) -> list[Path]:
    return sorted(folder.rglob(f"*{code_cache.ENDING}"))


def taken(body) -> bool:
    """Whether a compiled function came from the disk; it is right either way."""
    made = jit.compiled(REAL, body, cache=True)
    assert made.ctypes(1.5) == body(1.5)
    return bool(made.cache_hits)


def test_processes_share_compiled_code_under_equal_symbols(adder):
    assert said(python(COMPILES, 2.0, folder=adder)) == [[0, 3.0]]
    assert said(python(COMPILES, 5.0, folder=adder)) == [[0, 6.0]]  # its symbols are those of the first
    assert said(python(COMPILES, 5.0, 2.0, 7.0, folder=adder)) == [[1, 6.0], [1, 3.0], [0, 8.0]]


def test_processes_that_write_at_once_do_no_harm(adder):
    running = [python(COMPILES, *terms, folder=adder) for terms in ((1, 2, 3), (3, 2, 1), (2, 1, 3))]
    sums = [[value for _, value in said(process)] for process in running]
    assert sums == [[2.0, 3.0, 4.0], [4.0, 3.0, 2.0], [3.0, 2.0, 4.0]]
    assert len(stored(adder)) == 3
    assert said(python(COMPILES, 1, 2, 3, folder=adder)) == [[1, 2.0], [1, 3.0], [1, 4.0]]


@pytest.mark.parametrize("damage", ["empty", "cut", "flipped", "garbage", "folder", "unreadable"])
def test_a_damaged_file_is_compiled_and_written_anew(cached, damage):
    assert [taken(scaled(2.0)), taken(scaled(2.0))] == [False, True]
    [path] = stored(cached)
    held = path.read_bytes()
    if damage == "flipped":
        for place in range(0, len(held), len(held) // 20):
            path.write_bytes(held[:place] + bytes([held[place] ^ 16]) + held[place + 1 :])
            assert [taken(scaled(2.0)), taken(scaled(2.0))] == [False, True]
    elif damage == "folder":
        path.unlink()
        path.mkdir()
        assert [taken(scaled(2.0)), taken(scaled(2.0))] == [False, False]
    elif damage == "unreadable":
        path.unlink()
        path.symlink_to(path)
        assert [taken(scaled(2.0)), taken(scaled(2.0))] == [False, True]
    else:
        path.write_bytes({"empty": b"", "cut": held[: len(held) // 2], "garbage": b"garbage" * 99}[damage])
        assert [taken(scaled(2.0)), taken(scaled(2.0))] == [False, True]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), ScenarioError("cannot write")])
def test_a_disk_that_refuses_is_done_without(cached, monkeypatch, error):
    def refused(path):
        raise error

    monkeypatch.setattr(files, "replacing", refused)
    assert [taken(scaled(2.0)), taken(scaled(2.0))] == [False, False]
    assert stored(cached) == []


def test_no_folder_to_write_is_done_without(monkeypatch):
    def nowhere(*arguments):
        raise RuntimeError("cannot cache function: no locator available")

    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(code_cache, "CompileResultCacheImpl", nowhere)
    assert not taken(scaled(2.0))


def test_a_full_folder_loses_its_oldest_half(cached, monkeypatch):
    monkeypatch.setattr(code_cache, "MAX_FILES", 4)
    for factor in (1.0, 2.0, 3.0, 4.0, 5.0):
        assert not taken(scaled(factor))
        for path in stored(cached):  # each a second older than the next
            os.utime(path, (path.stat().st_atime, path.stat().st_mtime - 1.0))
    assert len(stored(cached)) == 3
    assert [taken(scaled(factor)) for factor in (3.0, 4.0, 5.0, 1.0)] == [True, True, True, False]


LIMIT = 2.0


@numba.njit
def limited(x):
    return min(x, LIMIT)


def calls_another(x):
    return limited(x) + 1.0


def test_a_key_changes_with_all_that_the_code_depends_on(monkeypatch):
    def key(body=calls_another, signature=REAL):
        code_cache.fingerprint._cached.cache_clear()
        return code_cache._key(body, signature)

    keys = [key(), key(scaled(2.0)), key(scaled(3.0)), key(signature=types.float32(types.float32))]
    with monkeypatch.context() as changed:
        changed.setenv("NUMBA_OPT", "1")
        keys.append(key())
    with monkeypatch.context() as changed:
        changed.setitem(globals(), "LIMIT", 3.0)
        keys.append(key())
    for module in (numba, code_cache.llvmlite):
        with monkeypatch.context() as changed:
            changed.setattr(module, "__version__", "0.0.1")
            keys.append(key())
    with monkeypatch.context() as changed:
        changed.setattr(code_cache.fingerprint, "package", lambda *without: "another")
        keys.append(key())
    with monkeypatch.context() as changed:
        codegen = code_cache.cpu_target.target_context.codegen()
        changed.setattr(codegen, "magic_tuple", lambda: ("x86_64", "another processor", ""))
        keys.append(key())
    assert len(set(keys)) == len(keys) == 10
    assert key() == keys[0]


@numba.cfunc(REAL)
def callback(x):
    return 3.0 * x


def calls_an_address(x):
    return callback(x)


def test_code_that_holds_addresses_of_its_process_is_not_kept(cached):
    made = jit.compiled(REAL, calls_an_address, cache=True)
    assert ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(made.address)(1.5) == 4.5
    assert stored(cached) == []


def keys_of_shipped(reverse: bool = False) -> list[str]:
    """The cache's keys of all shipped laws, surfaces and estimators; nothing is compiled."""
    kinds = (smc.law, smc.laws), (smc.surface, smc.surfaces), (smc.estimator, smc.estimators)
    found = sorted((find.__name__, name, find(name)) for find, names in kinds for name in names())
    keys, compiled = [], jit.compiled

    class Compiled:
        """What stands for a compiled function."""

        address = 0

    def keyed(signature, body, cache=False):
        assert cache, "what is shipped is kept"
        keys.append(code_cache._key(body, signature))
        return Compiled()

    jit.compiled = keyed
    try:
        order = found[::-1] if reverse else found
        for _, _, component in order:
            if component.function is not None and not isinstance(component.function, jit.Uncompiled):
                kind = native.estimator if component.kind == "estimator" else native.law
                kind.__wrapped__(component.function, tuple(component.gains), component.memory)
    finally:
        jit.compiled = compiled
    return keys[::-1] if reverse else keys


def test_every_shipped_component_has_one_key_in_all_processes(tmp_path):
    process = python(KEYS.format(module=Path(__file__).stem), folder=tmp_path)
    out, _ = process.communicate(timeout=300)
    mine = keys_of_shipped()
    assert len(mine) > 40
    assert out.split() == mine


def test_a_users_own_law_is_not_kept(cached):
    @smc.law_function(gains={"k": 2.0})
    def mine(y, gains, memory):
        return -gains.k * y.e, y.e

    law = mine()
    function = native.law.__wrapped__(law.function, tuple(law.gains), law.memory)
    assert not isinstance(function._cfunc._cache, code_cache.Cache)
    assert stored(cached) == []
