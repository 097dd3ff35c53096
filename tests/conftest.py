"""What the tests share: this package's plugin, also where it is not installed, and pytest's for testing plugins.

    pytest --quick    # the first case of every test, in files whose tests take little

Compiled code is kept in one folder, so that all workers, all child processes, and copies of the package that tests
install elsewhere compile a function once.
"""

import gc
import importlib
import os
from pathlib import Path

import pytest

pytest_plugins = ["pytester"]

ROOT = Path(__file__).parents[1]
os.environ.setdefault("NUMBA_CACHE_DIR", str(ROOT / ".pytest_cache" / "numba"))

# What --quick takes: files whose tests need less than about 0.1 s of processor time each, counting first cases.
QUICK = {
    "analysis/test_linear_theory.py",
    "analysis/test_ranking.py",
    "analysis/tuning/test_search_space.py",
    "cli/test_law_pages.py",
    "control/test_estimator.py",
    "control/test_gain_sets.py",
    "control/test_general_laws.py",
    "control/test_policy.py",
    "control/test_surface.py",
    "draw/test_style.py",
    "draw/test_viewer.py",
    "mechanisms/hardware/test_contact.py",
    "mechanisms/hardware/test_drives.py",
    "mechanisms/hardware/test_encoder.py",
    "mechanisms/hardware/test_friction.py",
    "mechanisms/hardware/test_drive_step.py",
    "mechanisms/test_fidelity.py",
    "mechanisms/test_models.py",
    "metrics/test_catalogue.py",
    "simulation/test_conditions.py",
    "simulation/test_offsets.py",
    "simulation/test_realistic.py",
    "simulation/test_scenario.py",
    "simulation/test_scenario_warnings.py",
    "simulation/test_signals.py",
    "studies/test_run_key.py",
    "test_architecture.py",
    "test_readme.py",
    "testing/test_step_responses.py",
}

# Files that take longest: more than about 10 s. They run first, so that at the end no core has to wait for one.
LONG = {
    "analysis/test_chattering.py",
    "analysis/test_gains_for.py",
    "analysis/tuning/test_search.py",
    "cli/test_main.py",
    "exchange/c/test_joint_c.py",
    "exchange/c/test_load.py",
    "draw/film/test_film.py",
    "exchange/live/test_live_page.py",
    "draw/test_figure.py",
    "draw/test_figure_looks.py",
    "envs/test_gymnasium_env.py",
    "mechanisms/custom/test_plant_from.py",
    "mechanisms/hardware/test_contact.py",
    "mechanisms/test_underactuated.py",
    "exchange/fmu/test_fmu_export.py",
    "simulation/test_lockstep.py",
    "simulation/test_realistic.py",
    "simulation/test_run.py",
    "evidence/audit/test_claims.py",
    "evidence/certificates/test_certify.py",
    "evidence/papers/test_shipped_papers.py",
    "evidence/report/test_report.py",
    "studies/test_executors.py",
    "studies/test_kills.py",
    "studies/test_scene.py",
    "test_fuzz.py",
    "test_notebooks.py",
    "test_packaging.py",
    "test_readme.py",
    "evidence/rigs/test_identify.py",
}


def pytest_addoption(parser: pytest.Parser, pluginmanager: pytest.PytestPluginManager) -> None:
    """Load the plugin, unless its entry point has: then, with its options, before they are read."""
    if not pluginmanager.hasplugin("smc_mujoco") and not pluginmanager.hasplugin("smc_mujoco.testing.plugin"):
        pluginmanager.register(importlib.import_module("smc_mujoco.testing.plugin"), "smc_mujoco")
    parser.addoption("--quick", action="store_true", help="only the first case of each test, of files that take little")


def pytest_collection() -> None:
    """Collect tests without a garbage collector: what they make stays."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Exclude the present objects from garbage collection, which would take half a second each time to visit them."""
    gc.enable()
    gc.freeze()


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out files that are not quick, where that is asked for."""
    left_out = collection_path.suffix == ".py" and _name(collection_path) not in QUICK
    return True if config.getoption("quick") and left_out else None


def _name(path: Path) -> str:
    """Return the name of a file of tests as in the sets above."""
    return path.as_posix().removeprefix(f"{ROOT.as_posix()}/tests/")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put long files first. Keep the first case of each test, where that is asked for."""
    items.sort(key=lambda item: _name(item.path) not in LONG)
    if config.getoption("quick"):
        first = set({item.nodeid.split("[")[0]: item for item in reversed(items)}.values())
        config.hook.pytest_deselected(items=[item for item in items if item not in first])
        items[:] = [item for item in items if item in first]


@pytest.fixture(autouse=True, scope="session")
def fixed_noise_key():
    """Draw the same noise key for every study, so that tests have the same numbers each time."""
    from smc_mujoco.studies import noise_key

    noise_key.draw = lambda: 20_090_531
