"""Classes of data are frozen, compared by value, shown with their fields and made by keyword: all but those here."""

import contextlib
import dataclasses
import importlib
import pkgutil

import pytest

import smc_mujoco
from smc_mujoco.mechanisms.hardware.part import Part
from smc_mujoco.simulation.signals import Signal

pytestmark = pytest.mark.quick

OTHERWISE = {  # flag -> the classes that lack it; for "slots", those that have it
    "frozen": {"margins.Search", "Trials", "Frames", "BorrowedData", "Tip", "runs.Runs"},
    "eq": {
        *("Linear", "Basin", "Member", "Network", "Frames", "Certificate", "Levels", "BorrowedData", "runs.Runs"),
        *("Explained", "Sensitivity"),
        *("Scenario", "Trace", "Advice", "Compared", "Outcome", "Table", "WorstCase", "StepResponse", "Mechanism"),
    },
    "repr": {
        *("Tuned", "Frames", "Held", "TimeSeries", "Waypoints"),
        *("board.Board", "Advice", "Compared", "StepResponse", "Robustness"),
    },
    "slots": {"Functions", "Packed", "Prepared"},
}
POSITIONAL = {  # made by position, as signals and parts of machines are
    *("Clock", "Wave", "StepChange", "Trials", "Member", "Added", "LinearLaw", "File", "Network", "Policy", "Gain"),
    *("Frames", "Audit", "Robustness", "Identified", "Columns", "Piece", "Point", "Slopes", "rig.Part", "Quantity"),
    *("FmuLaw", "Source", "BorrowedData", "NominalModel", "UserFields", "UserModel", "Tip", "Condition"),
    *("Jump", "Noise", "Functions", "Packed", "Prepared", "Mechanism", "runs.Runs"),
}


def classes():
    """Yield the classes of data of all modules whose packages are installed."""
    for found in pkgutil.walk_packages(smc_mujoco.__path__, "smc_mujoco."):
        if found.name.endswith("__main__"):
            continue
        with contextlib.suppress(ImportError):
            module = importlib.import_module(found.name)
            local = (one for one in vars(module).values() if getattr(one, "__module__", "") == module.__name__)
            yield from (one for one in local if isinstance(one, type) and "__dataclass_params__" in vars(one))


def test_a_class_of_data_is_made_and_compared_as_the_others_are():
    known = list(classes())
    assert len(known) > 120
    for one in known:
        room = one.__module__.rpartition(".")[2]
        params, names = one.__dataclass_params__, {one.__name__, f"{room}.{one.__name__}"}
        flags = {flag for flag in ("frozen", "eq", "order", "repr", "unsafe_hash") if getattr(params, flag)}
        flags |= {"slots"} if "__slots__" in vars(one) else set()
        assert flags == {"frozen", "eq", "repr"} ^ {flag for flag in OTHERWISE if names & OTHERWISE[flag]}, one
        by_keyword = not names & POSITIONAL and not issubclass(one, Signal | Part)
        assert not by_keyword or all(field.kw_only for field in dataclasses.fields(one) if field.init), one
