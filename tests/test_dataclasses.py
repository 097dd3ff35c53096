"""Classes of data are frozen, compared and made by keyword as they were: a hash, a cache and a caller rely on it."""

import dataclasses
import importlib
import pkgutil

import pytest
from helpers.words import recorded

import smc_mujoco

pytestmark = pytest.mark.quick

FOLDERS = ("analysis", "control", "envs", "mechanisms", "metrics", "simulation", "testing")
ROOTS = [importlib.import_module(f"smc_mujoco.{name}") for name in FOLDERS]
FOUND = [one.name for root in ROOTS for one in pkgutil.walk_packages(root.__path__, f"{root.__name__}.")]
MODULES = [importlib.import_module(name) for name in FOUND if not name.endswith("_env")]  # those need other packages
CLASSES = {
    f"{module.__name__.removeprefix(smc_mujoco.__name__)}.{name}": one
    for module in MODULES
    for name, one in vars(module).items()
    if isinstance(one, type) and "__dataclass_params__" in vars(one) and one.__module__ == module.__name__
}


@pytest.mark.parametrize("name", recorded(__file__, CLASSES))
def test_a_class_of_data_is_made_and_compared_as_recorded(name, snapshot):
    flags = CLASSES[name].__dataclass_params__
    said = [flag for flag in ("frozen", "eq", "order", "repr", "unsafe_hash") if getattr(flags, flag)]
    said += ["slots"] * ("__slots__" in vars(CLASSES[name]))
    fields = [one.name + " (by name)" * bool(one.kw_only) for one in dataclasses.fields(CLASSES[name]) if one.init]
    assert f"{', '.join(said)}: {', '.join(fields)}" == snapshot
