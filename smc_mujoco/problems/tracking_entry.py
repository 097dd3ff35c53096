"""Entries of the suites of tracking problems: a law, and what is added to its command.

    pid                                 a law of the library
    my_law.py                           a law of your own
    pid(ki=0) + Feedforward(1)          beside a compensation that knows the friction
    pid + Feedforward(.7, speed)        30 % less than it is, at the measured speed
    pid(ki=0) + Dither(1)               beside a square wave as high as the dry friction, 8 ms

A gain that is given as 0 leaves out a term of the law; every other gain is searched, also one that
is given.
"""

import dataclasses
import math
import re

from smc_mujoco.common.data import frozen_data, keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.control.component import Component
from smc_mujoco.control.from_text import law as law_of
from smc_mujoco.control.units import FORCE
from smc_mujoco.mechanisms.hardware.feedforward import Feedforward
from smc_mujoco.mechanisms.hardware.part import Positive
from smc_mujoco.problems.tracking import TrackingProblem
from smc_mujoco.simulation.signals import Signal

BESIDE = re.compile(
    r"(?P<kind>Feedforward|Dither)\(\s*(?P<share>[\d.eE+-]+)\s*(,\s*(?P<on>reference|speed)\s*)?\)"
)
PLUS = " + "
DITHER = 8e-3  # s, of a square wave; two control periods at least


@frozen_data
class SquareWave(Signal):
    """amplitude in the first half of each period, -amplitude in the second."""

    amplitude: float
    period: Positive

    @staticmethod
    def value(t, p):
        half = math.floor(2.0 * t / p.period + 1e-6)
        return (p.amplitude if half % 2 == 0 else -p.amplitude), 0.0, 0.0


@keyword_dataclass
class TrackingEntry:
    """An entry."""

    text: str  # as it was given
    law: Component
    kind: str = ""  # what stands beside the law: "Feedforward", "Dither" or ""
    share: float = 0.0  # of the problem's friction, which it gives
    on: str = "reference"  # the speed at which a Feedforward looks

    @property
    def name(self) -> str:
        """The name in tables, with the gains that were given as 0."""
        template = self.law.template
        left_out = []
        for gain, declared in (template.gains if template else {}).items():
            if self.law.gains[gain] == 0.0 != declared.default:
                left_out.append(f"{gain}=0")
        law = f"{self.law.name}({', '.join(left_out)})" if left_out else self.law.name
        if not self.kind:
            return law
        speed = ", speed" if self.on == "speed" else ""
        return f"{law} + {self.kind}({self.share:g}{speed})"

    def law_on(self, problem: TrackingProblem) -> Component:
        """Return the law, with a bound on its integral where it has a gain for that."""
        template = self.law.template
        bounds = {}
        for name, gain in (template.gains if template else {}).items():
            if gain.held and gain.unit == FORCE and self.law.gains[name] == math.inf:
                bounds[name] = problem.bound
        return dataclasses.replace(self.law, gains={**self.law.gains, **bounds})

    def beside(self, problem: TrackingProblem, loaded: bool = True) -> Feedforward | Signal | None:
        """Return what is added to the command in a problem; without its friction there is nothing
        that it would give. Raise ScenarioError where a problem has no friction.
        """
        if not self.kind:
            return None
        if not problem.friction:
            raise ScenarioError(
                f"entry {self.text!r} gives a share of the friction, and problem {problem.name} "
                "has none: enter the law alone"
            )
        share = self.share if loaded else 0.0
        if self.kind == "Feedforward":
            return Feedforward(problem.friction, on=self.on, eps=problem.slow, error=share - 1.0)
        level = max(_levels(problem))
        return SquareWave(share * level, max(DITHER, 2.0 * problem.period))


def _levels(problem: TrackingProblem) -> list[float]:
    """Return the dry forces of a problem's friction, N or N m."""
    forces = []
    for part in problem.friction:
        for name in ("level", "coulomb", "kc"):
            forces.append(getattr(part, name, 0.0))
    return forces


def tracking_entry(text: str) -> TrackingEntry:
    """Return the entry of a text. Raise ScenarioError for what is none."""
    kind, share, on = beside_of(text)
    law = law_of(text.partition(PLUS)[0].strip())
    return TrackingEntry(text=text, law=law, kind=kind, share=share, on=on)


def beside_of(text: str) -> tuple[str, float, str]:
    """Return what a text of an entry adds to its law: kind, share, and speed; see TrackingEntry.

    Raise ScenarioError for what cannot be added.
    """
    _, plus, tail = text.partition(PLUS)
    if not plus:
        return "", 0.0, "reference"
    beside = BESIDE.fullmatch(tail.strip())
    if beside is None:
        raise ScenarioError(
            f"entry {shown(text)} adds {shown(tail)} to its law: give Feedforward(1), "
            "Feedforward(0.7, speed) or Dither(1), a share of the problem's friction"
        )
    return beside["kind"], float(beside["share"]), beside["on"] or "reference"
