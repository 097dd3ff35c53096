"""What is proven of a law on a plant, as data: theorems, their conditions with margins, regions and
bounds.
"""

import copy
import dataclasses
import json
import math
import os
from collections.abc import Mapping, Sequence
from itertools import starmap
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from smc_mujoco.common import html
from smc_mujoco.common.errors import ScenarioError, printable
from smc_mujoco.common.extras import extra
from smc_mujoco.common.files import reading, with_ending, write_json
from smc_mujoco.common.text import number
from smc_mujoco.evidence.certificates import loops
from smc_mujoco.mechanisms.plant import EFFORT

if TYPE_CHECKING:
    from smc_mujoco.simulation.trace import Trace

# Condition -> unit of its margin (x: unit of position, F: of force), what it asks, and what it
# means where it fails.
CONDITIONS = {
    "damping": ("F s/x", "D(x) >= 0 for every x", "the plant itself feeds the motion"),
    "restoring": (
        "",
        "sigma(c x) > phi(x) for every x > 0",
        "the plant pulls harder than the law pushes",
    ),
    "actuator": ("F", "|u| <= u_max", "the law asks for more than the actuator gives"),
    "coupling": (
        "F/x",
        "the coupling is a spring that pulls together",
        "the coupling can push apart",
    ),
    "local": ("F/x", "sigma'(0) c > phi'(0)", "the law is too soft near 0"),
    "start": ("", "the scenario's start lies in the region", "the start lies outside of it"),
    "reaching": ("F", "k > |phi + (M c - D) v| + d0", "k does not exceed d and the plant together"),
    "integral": ("F/s", "k2 > d'", "the integral is slower than d"),
    "slope": ("F/s", "|delta'| <= L", "what the integral must follow is too fast"),
}
THEOREMS = {  # theorem -> what it says
    "saturated PD": "V = M v²/2 + ∫ σ(c y) − φ(y) dy never rises, and only rest keeps it (LaSalle)",
    "level sets": "W falls between two of its levels, whatever d does within its bound",
    "reaching": "s = 0 is reached and kept, and x decays on it",
    "super-twisting": "a quadratic form of (√|s| sgn s, w + δ) falls until s = s' = 0 (Moreno and Osorio 2012)",
}


class Condition(NamedTuple):
    """A condition of a theorem."""

    theorem: str
    name: str  # as in the certificate's data
    margin: float  # by how much it holds, negative where it fails
    unit: str  # of the margin; "" for a share
    words: str  # what it asks, or what its failure means
    holds: bool


def holds(name: str, margin: float) -> bool:
    """Return whether a condition holds with a margin.

    A margin of 0 is enough for all but "reaching".
    """
    return margin > 0.0 or (margin == 0.0 and name != "reaching")


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Certificate:
    """What is proven of a law on a plant.

    `smc.certify` makes it, and a separate checker has accepted it.

    Attributes:
      data: all of it, as in its file: plant, law, bounds of the disturbance, theorems with their
        conditions and what proves them (polynomials, boxes, numbers), what is left out, and a seal.
    """

    data: Mapping[str, Any]

    def __repr__(self) -> str:
        return printable(
            f"<Certificate of {self.law} on {self.plant}: {'; '.join(self.sentences[:-1])}>"
        )

    def _repr_html_(self) -> str:
        rows = []
        for row in self.conditions:
            rows.append(
                (
                    row.theorem,
                    row.name,
                    "yes" if row.holds else "no",
                    f"{number(row.margin)} {row.unit}",
                    row.words,
                )
            )
        return html.table(
            ("theorem", "condition", "holds", "margin", ""), rows, note=". ".join(self.sentences)
        )

    @property
    def plant(self) -> str:
        """Name of the plant."""
        return self.data["plant"]["name"]

    @property
    def law(self) -> str:
        """Name of the law."""
        return self.data["law"]["name"]

    @property
    def theorems(self) -> tuple[str, ...]:
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
        """Whether the scenario's start provably comes to rest or into the bound, apart from what
        `leaves_out` names.
        """
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
            for name, margin in ((row["name"], row["margin"]) for row in part["conditions"]):
                unit, asks, fails = CONDITIONS[name]
                unit, held = unit.replace("x", x).replace("F", EFFORT[x]), holds(name, margin)
                made.append(
                    Condition(part["theorem"], name, margin, unit, asks if held else fails, held)
                )
        return tuple(made)

    @property
    def leaves_out(self) -> Mapping[str, str]:
        """What no theorem here is about -> what the scenario has of it, such as "Lag(tau=0.01)"; ""
        for nothing.
        """

        def said(word: str, numbers: Mapping[str, float]) -> str:
            if numbers:
                return (
                    f"{word}({', '.join(f'{name}={value:g}' for name, value in numbers.items())})"
                )
            return word

        return {
            what: ", ".join(starmap(said, its.items()))
            for what, its in self.data["leaves_out"].items()
        }

    @property
    def sentences(self) -> tuple[str, ...]:
        """What is proven: a sentence for each theorem, one if none is about d, and one on what all
        leave out.
        """
        here = "; ".join(f"{name} ({what})" for name, what in self.leaves_out.items() if what)
        absent = ", ".join(name for name, what in self.leaves_out.items() if not what)
        left_out = (
            f"no theorem here is about {here}"
            + f"; nor about what is not here: {absent}" * bool(absent)
        )
        d0 = self.data["disturbance"]
        unit = EFFORT[self.data["unit"]]
        silent = d0 > 0.0 and self.theorems == ("saturated PD",)
        nothing = (f"nothing is proven under every |d| <= {d0:g} {unit}",) * silent
        return *(self._sentence(part) for part in self.data["parts"]), *nothing, left_out

    def _sentence(self, part: Mapping[str, Any]) -> str:
        """Return what a theorem says of this plant, or which of its conditions fail and by how
        much.
        """
        theorem = part["theorem"]
        x = self.data["unit"]
        d0 = self.data["disturbance"]
        if d0:
            under = f"under every |d| <= {d0:g} {EFFORT[x]}"
        else:
            under = "without d"
        failing = [row for row in self.conditions if row.theorem == theorem and not row.holds]
        if theorem == "level sets":
            wide = f"starts up to |x| = {number(self._widest(part))} {x} at rest"
            if self.rests:
                ends = "come to rest"
            else:
                ends = f"end in |x| <= {number(part['bound'])} {x}"
            outside = "; the scenario's start is not among them" * bool(failing)
            return f"proven by level sets: {wide} {ends} {under}{outside}"
        if failing:
            margins = []
            for row in failing:
                margins.append(
                    f"{row.name} {number(row.margin)} {row.unit}".strip() + f" ({row.words})"
                )
            return f"not proven by {theorem}: {', '.join(margins)}"
        if theorem == "saturated PD":
            near = ", exponentially in the end" * any(
                row.name == "local" for row in self.conditions
            )
            return f"proven by saturated PD: without d every start comes to rest at 0{near}"
        if theorem == "reaching":
            where = f"|x| <= {number(part['X'])} {x}"
            if part["S"]:
                where += f" with |s| <= {number(part['S'])} {x}/s"
                return f"proven by reaching: from {where} s = 0 is reached and kept, and x decays, {under}"
            gains = self.data["law"]["gains"]
            after = part["X"] ** (1.0 - gains["p"]) / (gains["b"] * (1.0 - gains["p"]))
            return (
                f"proven by reaching: on s = 0 in {where} x is 0 after {number(after)} s, {under}"
            )
        rate = f" and |d'| <= {self.data['slope']:g} {EFFORT[x]}/s" * bool(self.data["slope"])
        where = f"|x| <= {number(part['X'])} {x}"
        return f"proven by super-twisting: from a set in {where} s = 0 is reached, {under}{rate}"

    def _widest(self, part: Mapping[str, Any]) -> float:
        """Return the largest x up to which all states at rest lie in the level sets."""
        x = np.linspace(0.0, part["x"][-1], 2001)
        outside = self.level(x, np.zeros_like(x)) > part["outer"]
        if outside.any():
            return float(x[max(int(np.argmax(outside)) - 1, 0)])
        return float(x[-1])

    def contains(self, x: Any, v: Any) -> np.ndarray:
        """Return whether each state lies in the region from which all come to rest or into the
        bound.

        Args:
          x, v: positions and velocities, arrays of one shape, rad or m and per second; w of
            super_twisting is 0.
        """
        x, v = np.asarray(x, float), np.asarray(v, float)
        inside = np.full(x.shape, self.stable and not self.data["disturbance"])
        if part := self._part("level sets"):
            inside |= self.level(x, v) <= part["outer"]
        if (part := self._part("reaching", holding=True)) and part["S"]:
            inside |= (np.abs(x) <= part["X"]) & (
                np.abs(v + self.data["law"]["gains"]["c"] * x) <= part["S"]
            )
        return inside

    def level(self, x: Any, v: Any) -> np.ndarray:
        """Return W of "level sets" at states, 1 outside of its grid; see `contains` for the
        arguments.
        """
        part = self._part("level sets")
        if part is None:
            raise ScenarioError(f"the certificate of {self.law} on {self.plant} has no level sets")
        x, v, c = np.asarray(x, float), np.asarray(v, float), self.surface
        xs, ss, W = (np.array(part[key]) for key in ("x", "s", "W"))
        sign = np.where(x >= 0.0, 1.0, -1.0)
        px = x * sign
        ps = (v + c * x) * sign
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

    def _part(self, theorem: str, holding: bool = False) -> Mapping[str, Any] | None:
        parts = []
        for part in self.data["parts"]:
            if part["theorem"] == theorem and (part["holds"] or not holding):
                parts.append(part)
        return parts[0] if parts else None

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

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write a .json file that `Certificate.load` and the checker read."""
        return write_json(with_ending(path, ".json"), self.data, indent=None)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> "Certificate":
        """Read a file of `save`. It is not checked: call `check`.

        Raises:
          ScenarioError: no such file, or no certificate.
        """
        with reading(path, "certificate", "give a .json file that Certificate.save wrote") as file:
            made = cls(data=json.loads(file.read_text(encoding="utf-8"), object_pairs_hook=_once))
            made.sentences  # noqa: B018  # raises if the file is no certificate
            return made

    def figure(
        self,
        path: str | os.PathLike[str] | None = None,
        traces: "Sequence[Trace]" = (),
        worst_of: int = 0,
    ):
        """Draw the state plane: region, level sets, bound, and runs, such as the worst found.

        Args:
          path: of the files PATH.svg and PATH.png, or of a .pdf; None: nothing is written.
          traces: runs of the same plant.
          worst_of: of how many runs they are the worst found; 0: of none.

        Raises:
          ScenarioError: an unknown kind of file, or a network, whose states do not fit into a
            plane.
        """
        from smc_mujoco.evidence.certificates.figure import draw

        return draw(self, traces, path, worst_of)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return the dict of a JSON object. Raise ValueError if it names a field twice."""
    if len(dict(pairs)) < len(pairs):
        raise ValueError("a field is there twice")
    return dict(pairs)


def finite(value: float) -> float | None:
    """Return a number, or None for an infinite one, which JSON lacks."""
    return float(value) if math.isfinite(value) else None
