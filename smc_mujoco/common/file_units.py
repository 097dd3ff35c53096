"""Units as people write them in the headings of logs and tables, and what they are in SI.

heading("x [deg]")  # Heading(name="x", quantity="angle", factor=pi / 180)
heading("u")  # Heading(name="u", quantity="", factor=1.0): no unit is written
"""

import math
import re
from typing import NamedTuple

from smc_mujoco.common.errors import ScenarioError, shown

TURN = 2.0 * math.pi
# quantity -> unit -> its size in s, rad, m, rad/s, m/s, N m, N, V or A
UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0}
    | {"ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0},
    "angle": {"rad": 1.0, "radian": 1.0, "radians": 1.0, "mrad": 1e-3}
    | {"deg": TURN / 360.0, "degree": TURN / 360.0, "degrees": TURN / 360.0, "°": TURN / 360.0}
    | {"rev": TURN, "turn": TURN, "turns": TURN},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6},
    "angular speed": {"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": TURN / 360.0, "°/s": TURN / 360.0}
    | {"rpm": TURN / 60.0, "rev/s": TURN},
    "speed": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
    "torque": {"N m": 1.0, "Nm": 1.0, "N*m": 1.0, "N.m": 1.0, "N-m": 1.0, "N·m": 1.0}
    | {"mN m": 1e-3, "mNm": 1e-3, "kN m": 1e3, "kNm": 1e3},
    "force": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "voltage": {"V": 1.0, "mV": 1e-3},
    "current": {"A": 1.0, "mA": 1e-3},
}
WITH_UNIT = re.compile(r"(.*\S)\s*(?:\[([^\]]*)\]|\(([^)]*)\))")


class Heading(NamedTuple):
    """The heading of a column: its name, and what its numbers are to be multiplied by."""

    name: str
    quantity: str  # of UNITS; "" where no unit is written
    factor: float


def heading(text: str, quantities: tuple[str, ...] = ()) -> Heading:
    """Return what a heading says, of a column that may be of one of some quantities; () for any.

    Raises:
      ScenarioError: an unknown unit, or one of another quantity.
    """
    written = WITH_UNIT.fullmatch(text.strip())
    if written is None:
        return Heading(text.strip(), "", 1.0)
    name = written[1]
    unit = (written[2] or written[3] or "").strip()
    if not unit:
        return Heading(name, "", 1.0)
    of_column = {q: UNITS[q] for q in quantities or UNITS}
    for quantity, sizes in of_column.items():
        if unit in sizes:
            return Heading(name, quantity, sizes[unit])
    allowed = ", ".join(next(iter(sizes)) for sizes in of_column.values())
    raise ScenarioError(
        f"column {shown(text)} is in {unit!r}, which is none of its units: give it in {allowed}"
    )
