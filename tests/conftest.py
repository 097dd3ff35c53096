"""What the tests share: this package's plugin, also where it is not installed, and pytest's for
testing plugins.

    pytest --quick            # the first case of each test that is marked quick
    pytest -m "not slow"      # without tests of over 0.3 s whose lines faster ones run, too

Compiled code is kept in the user's cache, see `common.jit.Cache`, so that all workers, child
processes, clones, and copies of the package that tests install elsewhere compile a function once. Bytecode is kept too: otherwise each
worker would compile all tests again.
"""

import gc
import importlib
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

pytest_plugins = ["pytester"]
# on a busy machine an example takes as long as it takes
settings.register_profile("any_clock", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any_clock")

ROOT = Path(__file__).parents[1]
CURE = re.compile(r": \S")  # after what is wrong stands what to do
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


def pytest_addoption(parser: pytest.Parser, pluginmanager: pytest.PytestPluginManager) -> None:
    """Load the plugin, unless its entry point has: then, with its options, before they are read."""
    if not pluginmanager.hasplugin("smc_mujoco") and not pluginmanager.hasplugin(
        "smc_mujoco.testing.plugin"
    ):
        pluginmanager.register(importlib.import_module("smc_mujoco.testing.plugin"), "smc_mujoco")
    parser.addoption(
        "--quick",
        action="store_true",
        help="only the first case of each test that is marked quick",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Take no record for unused where only first cases run, or none: syrupy tells tests apart, not
    their cases. The records of a missing annex are unused, too.
    """
    from helpers.annexes import HERE

    from smc_mujoco.common import gl
    from smc_mujoco.common.annexes import ANNEXES

    gl.choice()  # the first call decides, and some tests set MUJOCO_GL
    partly = config.getoption("quick") or config.getoption("collectonly") or HERE != ANNEXES
    config.option.disable_unused_snapshots |= partly


def pytest_collection() -> None:
    """Collect tests without a garbage collector: what they make stays."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Exclude the present objects from garbage collection, which would take half a second each time
    to visit them.
    """
    gc.enable()
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)  # a thirtieth of the time is in the 700 objects of the default


def pytest_pycollect_makeitem(collector: pytest.Collector, name: str, obj: object) -> list | None:
    """Make no cases of a test that is not marked quick, where quick tests are asked for."""
    if not collector.config.getoption("quick") or not name.startswith("test_"):
        return None
    own = any(mark.name == "quick" for mark in getattr(obj, "pytestmark", []))
    return None if own or collector.get_closest_marker("quick") else []


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep the first case of each test that is not slow, where quick tests are asked for."""
    if not config.getoption("quick"):
        return
    quick = [item for item in items if not item.get_closest_marker("slow")]
    first = set({item.nodeid.split("[")[0]: item for item in reversed(quick)}.values())
    config.hook.pytest_deselected(items=[item for item in items if item not in first])
    items[:] = [item for item in items if item in first]


@pytest.fixture
def refused() -> Callable[..., str]:
    """A function that checks that a call is refused in one sentence, which names what was given and
    ends in a cure.
    """
    from smc_mujoco.common.errors import ScenarioError

    def check(call: Callable[[], object], *parts: object) -> str:
        with pytest.raises(ScenarioError) as caught:
            call()
        sentence = str(caught.value)
        assert CURE.search(sentence), sentence
        assert "\n" not in sentence
        assert len(sentence) < 1250
        for part in parts:
            assert str(part) in sentence
        return sentence

    return check


@pytest.fixture
def coarse_grid(monkeypatch):
    """Seek limit cycles on a sixth of the grid's points.

    What is found there is refined as ever; a law with several cycles may lose one.
    """
    monkeypatch.setattr("smc_mujoco.chattering.prediction.GRID_FREQUENCIES", 23)
    monkeypatch.setattr("smc_mujoco.chattering.prediction.GRID_AMPLITUDES", 14)


@pytest.fixture
def by_mujoco(monkeypatch):
    """Tune by runs of MuJoCo: the equation of each law would be compiled for 5 s."""
    monkeypatch.setattr("smc_mujoco.analysis.tuning.equation.key_of", lambda case, device: None)


@pytest.fixture
def present_objects_frozen():
    """Exclude the present objects from a test's own `gc.collect`, which takes half a second with
    them.
    """
    gc.freeze()
