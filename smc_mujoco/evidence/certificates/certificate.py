"""What is proven of a law on a plant, as data: theorems, their conditions with margins, regions and
bounds.
"""

import copy
import dataclasses
import json
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.common.aliases import AnyPath, Array, Data, Names
from smc_mujoco.common.errors import ScenarioError, printable
from smc_mujoco.common.extras import extra
from smc_mujoco.common.files import reading, with_ending, write_json
from smc_mujoco.evidence.certificates import loops
from smc_mujoco.mechanisms.plant import EFFORT

# Condition -> unit of its margin (x: unit of position, F: of force), and what it asks.
CONDITIONS = {
    "damping": ("F s/x", "D(x) >= 0 for every x"),
    "restoring": ("", "sigma(c x) > phi(x) for every x > 0"),
    "actuator": ("F", "|u| <= u_max"),
    "coupling": ("F/x", "the coupling is a spring that pulls together"),
    "local": ("F/x", "sigma'(0) c > phi'(0)"),
    "start": ("", "the scenario's start lies in the region"),
    "reaching": ("F", "k > |phi + (M c - D) v| + d0"),
}
THEOREMS = {  # theorem -> what it proves where its conditions hold
    "saturated PD": "without d every start comes to rest at 0",
    "level sets": "whatever d does within its bound, W falls between two of its levels",
    "reaching": "s = 0 is reached and kept, and x decays on it",
}
NOT_ABOUT = (
    "no theorem here is about sampling, delay, noise, estimators, dry friction, contact, drives, "
    "other parameters or rounding"
)


class Condition(NamedTuple):
    """A condition of a theorem."""

    theorem: str
    name: str  # as in the certificate's data
    margin: float  # by how much it holds, negative where it fails
    unit: str  # of the margin; "" for a share
    asks: str
    holds: bool


def holds(name: str, margin: float) -> bool:
    """Return whether a condition holds with a margin.

    A margin of 0 is enough for all but "reaching".
    """
    return margin > 0.0 or (margin == 0.0 and name != "reaching")


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Certificate:
    """What is proven of a law on a plant.

    `smc.audits.certify` makes it, and a separate checker has accepted it.

    Attributes:
      data: all of it, as in its file: plant, law, bounds of the disturbance, theorems with their
        conditions and what proves them (polynomials, boxes, numbers), and a seal.
    """

    data: Data

    def __repr__(self) -> str:
        return printable(f"<Certificate of {self.law} on {self.plant}: {self.sentences[0]}>")

    @property
    def plant(self) -> str:
        """Name of the plant."""
        return self.data["plant"]["name"]

    @property
    def law(self) -> str:
        """Name of the law."""
        return self.data["law"]["name"]

    @property
    def theorems(self) -> Names:
        """The theorems that were tried."""
        return tuple(part["theorem"] for part in self.data["parts"])

    @property
    def theorem(self) -> str:
        """The first theorem that holds, or the first that was tried."""
        return next(
            (part["theorem"] for part in self.data["parts"] if part["holds"]), self.theorems[0]
        )

    @property
    def holds(self) -> bool:
        """Whether the scenario's start provably comes to rest or into the bound."""
        return self.bound is not None

    @property
    def stable(self) -> bool:
        """Whether every start provably comes to rest without a disturbance."""
        return self._part("saturated PD", holding=True) is not None

    @property
    def bound(self) -> float | None:
        """The largest |x| in the end, m or rad, from the scenario's start under every d within its
        bound, or None.
        """
        if not self.data["disturbance"] and self.stable:
            return 0.0
        part = self._part("level sets", holding=True)
        if part is None:
            return None
        return 0.0 if self.rests else part["bound"]

    @property
    def rests(self) -> bool:
        """Whether runs that begin in the level sets come to rest: without a disturbance, or if the
        law switches.
        """
        return not self.data["disturbance"] or loops.loop_of(self.data)[0].switches

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """All conditions of the theorems."""
        x = self.data["unit"]
        made = []
        for part in self.data["parts"]:
            for row in part["conditions"]:
                unit, asks = CONDITIONS[row["name"]]
                unit = unit.replace("x", x).replace("F", EFFORT[x])
                held = holds(row["name"], row["margin"])
                made.append(
                    Condition(part["theorem"], row["name"], row["margin"], unit, asks, held)
                )
        return tuple(made)

    @property
    def ranges(self) -> tuple[tuple[str, str, float, str], ...]:
        """From where and how far the theorems hold: (theorem, what, value, unit)."""
        x = self.data["unit"]
        found = []
        for part in self.data["parts"]:
            theorem = part["theorem"]
            if theorem == "level sets":
                found.append((theorem, "starts at rest up to |x|", self._widest(part), x))
                end = 0.0 if self.rests else part["bound"]
                found.append((theorem, "end in |x| up to", end, x))
            elif "X" in part and part["holds"]:
                found.append((theorem, "|x| up to", part["X"], x))
                found.append((theorem, "|s| up to", part["S"], f"{x}/s"))
        return tuple(found)

    @property
    def sentences(self) -> Names:
        """What each theorem proves, or which of its conditions fail, and what none is about."""
        sentences = []
        for part in self.data["parts"]:
            theorem = part["theorem"]
            rows = [row for row in self.conditions if row.theorem == theorem and not row.holds]
            fails = ", ".join(row.name for row in rows)
            if theorem == "level sets":  # the region is proven also where the start lies outside
                fails = ""
            if fails:
                sentences.append(f"not proven by {theorem}: {fails}")
            else:
                sentences.append(f"proven by {theorem}: {THEOREMS[theorem]}")
        if self.data["disturbance"]:
            unit = EFFORT[self.data["unit"]]
            under = f"|d| <= {self.data['disturbance']:g} {unit}"
            what = "d is any force with"
            if self.theorems == ("saturated PD",):
                what = "nothing is proven under"
            sentences.append(f"{what} {under}")
        return *sentences, NOT_ABOUT

    def _widest(self, part: Data) -> float:
        """Return the largest x up to which all states at rest lie in the level sets."""
        x = np.linspace(0.0, part["x"][-1], 2001)
        outside = np.flatnonzero(self.level(x, np.zeros_like(x)) > part["outer"])
        return float(x[max(outside[0] - 1, 0)] if len(outside) else x[-1])

    def contains(self, x: Any, v: Any) -> Array:
        """Return whether each state lies in the region from which all come to rest or into the
        bound.

        Args:
          x, v: positions and velocities, arrays of one shape, rad or m and per second.
        """
        x, v = np.asarray(x, float), np.asarray(v, float)
        inside = np.full(x.shape, self.stable and not self.data["disturbance"])
        if part := self._part("level sets"):
            inside |= self.level(x, v) <= part["outer"]
        if part := self._part("reaching", holding=True):
            inside |= (np.abs(x) <= part["X"]) & (
                np.abs(v + self.data["law"]["gains"]["c"] * x) <= part["S"]
            )
        return inside

    def level(self, x: Any, v: Any) -> Array:
        """Return W of "level sets" at states, 1 outside of its grid; see `contains` for the
        arguments.
        """
        part = self._part("level sets")
        if part is None:
            raise ScenarioError(f"the certificate of {self.law} on {self.plant} has no level sets")
        x, v = np.asarray(x, float), np.asarray(v, float)
        xs, ss, W = (np.array(part[key]) for key in ("x", "s", "W"))
        sign = np.where(x >= 0.0, 1.0, -1.0)
        px = x * sign
        ps = (v + self.surface * x) * sign
        i = np.clip(np.searchsorted(xs, px, side="right") - 1, 0, xs.size - 2)
        j = np.clip(np.searchsorted(ss, ps, side="right") - 1, 0, ss.size - 2)
        f = (px - xs[i]) / (xs[i + 1] - xs[i])
        g = (ps - ss[j]) / (ss[j + 1] - ss[j])
        W = (1 - f) * ((1 - g) * W[i, j] + g * W[i, j + 1]) + f * (
            (1 - g) * W[i + 1, j] + g * W[i + 1, j + 1]
        )
        return np.where((px < xs[-1]) & (np.abs(ps) < ss[-1]), W, 1.0)

    @property
    def surface(self) -> float:
        """The slope c of the law's surface s = v + c x, 1/s."""
        return loops.loop_of(self.data)[0].c

    def _part(self, theorem: str, holding: bool = False) -> Data | None:
        for part in self.data["parts"]:
            if part["theorem"] == theorem and (part["holds"] or not holding):
                return part
        return None

    def check(self) -> None:
        """Prove it again by the checker, in ball arithmetic.

        Raises:
          ScenarioError: a statement that is not proven.
          MissingPackageError: python-flint is not installed.
        """
        with extra("proof", "a check"):
            import flint  # noqa: F401
        from smc_mujoco.evidence.certificates import checker

        try:
            checker.check(copy.deepcopy(dict(self.data)))
        except checker.Refused as why:
            raise ScenarioError(f"the certificate is refused: not proven is {why}") from None

    def save(self, path: AnyPath) -> Path:
        """Write a .json file that `Certificate.load` and the checker read."""
        return write_json(with_ending(path, ".json"), self.data, indent=None)

    @classmethod
    def load(cls, path: AnyPath) -> "Certificate":
        """Read a file of `save`. It is not checked: call `check`.

        Raises:
          ScenarioError: no such file, or no certificate.
        """
        with reading(path, "certificate", "give a .json file that Certificate.save wrote") as file:
            made = cls(data=json.loads(file.read_text(encoding="utf-8")))
            made.sentences  # noqa: B018  # raises if the file is no certificate
            return made


def finite(value: float) -> float | None:
    """Return a number, or None for an infinite one, which JSON lacks."""
    return float(value) if math.isfinite(value) else None
