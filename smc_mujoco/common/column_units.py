"""Units in the heading of a log: `x (deg)`, `x [deg]`, `t [ms]`. Those that are known are converted
to SI units; another stays in the name, so that nothing is taken in a unit that it does not have.
"""

import math
import re
from collections.abc import Sequence

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.text import joined

HEADING = re.compile(r"#?\s*(?P<name>.*?)\s*(?:\[(?P<square>[^\]]*)\]|\((?P<round>[^)]*)\))?\s*")
SI = (
    "",
    "s",
    "rad",
    "m",
    "N",
    "N m",
    "V",
    "rad/s",
    "m/s",
    "rad/s^2",
    "m/s^2",
    "kg",
    "1",
)
# spelling -> its size in the SI unit
FACTORS = dict.fromkeys(SI, 1.0) | {
    "sec": 1.0,
    "seconds": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "µs": 1e-6,
    "ns": 1e-9,
    "radians": 1.0,
    "mrad": 1e-3,
    "deg": math.pi / 180.0,
    "degree": math.pi / 180.0,
    "degrees": math.pi / 180.0,
    "°": math.pi / 180.0,
    "rev": 2.0 * math.pi,
    "turns": 2.0 * math.pi,
    "deg/s": math.pi / 180.0,
    "°/s": math.pi / 180.0,
    "rpm": 2.0 * math.pi / 60.0,
    "mm": 1e-3,
    "cm": 1e-2,
    "mm/s": 1e-3,
    "kN": 1e3,
    "Nm": 1.0,
    "N*m": 1.0,
    "N·m": 1.0,
    "N.m": 1.0,
    "mN m": 1e-3,
    "mNm": 1e-3,
    "N mm": 1e-3,
    "Nmm": 1e-3,
    "N cm": 1e-2,
    "Ncm": 1e-2,
    "mV": 1e-3,
    "volts": 1.0,
}


def headings(texts: Sequence[str], what: str) -> tuple[list[str], list[float]]:
    """Return the names of columns without units that are known, and the factors to SI units.

    Raises:
      ScenarioError: two columns have one name.
    """
    names, factors = [], []
    for text in texts:
        match = HEADING.fullmatch(text)
        unit = (match["square"] or match["round"] or "") if match else ""
        factor = FACTORS.get(unit.strip())
        if match and factor is not None:
            names.append(match["name"])
            factors.append(factor)
        else:  # the unit stays in the name
            names.append(text.lstrip("# ").strip())
            factors.append(1.0)
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ScenarioError(
            f"{what} has two columns {joined(twice)}: rename one, or leave it out, as only one can "
            "be meant"
        )
    return names, factors


def with_unit(name: str, columns: Sequence[str]) -> str:
    """Return the column that has a name and a unit that is not known; "" if there is none."""
    for column in columns:
        match = HEADING.fullmatch(column)
        if match and match["name"] == name and column != name:
            return column
    return ""
