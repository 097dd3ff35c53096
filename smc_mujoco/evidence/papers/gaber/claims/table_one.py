"""The paper's table I: five properties of four laws, each cell a mark that is measured.

A property is a number of a law, the worst over the five plants of the study. The mark is + if it meets a limit, which
the note of the claim states. "Bounded input" compares the largest |u| that the law asks for, before the actuator's
bound: at a constant distance of 100 |x0| against 10 |x0|, and after 2 s against 1 s; the larger growth counts.
"Delay-tolerant" is measured as in claim 61. A cell holds if our mark is the paper's.
"""

import math
from types import SimpleNamespace

import numpy as np

from smc_mujoco.common.rebuild import rebuild
from smc_mujoco.control.component import Component
from smc_mujoco.control.law import Measurement
from smc_mujoco.evidence.audit.runs import Runs
from smc_mujoco.evidence.audit.verdict import Beside, Check, check, ratio
from smc_mujoco.evidence.papers.gaber.claims.common import UNCLAMPED, scale
from smc_mujoco.evidence.papers.gaber.claims.searches import largest_delays
from smc_mujoco.evidence.papers.gaber.scenarios import CONTROL_PERIOD, LAWS

# columns of the paper's table, and its rows: property -> a mark a column
COLUMNS = {"classical": "classical", "HOSMC": "super_twisting", "adaptive": "adaptive", "proposed": "observer_free"}
MARKS = {
    "no chattering": "-+++",
    "observer-free": "+--+",
    "bounded input": "-+++",
    "delay-tolerant": "-+-+",
    "smoothness": "---+",
}
ESTIMATED = ("a", "q", "dq")  # of a Measurement: acceleration, and a joint that moves along
OPPOSITE = {"<": ">=", "<=": ">", ">": "<="}
# Cells that hold for any runs: of the law that is the reference, of laws without estimates, of tanh.
CERTAIN = {(name, "classical") for name in ("no chattering", "delay-tolerant", "observer-free")}
CERTAIN |= {("observer-free", "adaptive"), ("observer-free", "proposed"), ("bounded input", "proposed")}
HELD = 1.0  # s, chosen
PROBES = 50  # chosen


def table_one(runs: Runs) -> list[Check | Beside]:
    """Claim T: table I: no chattering, observer-free, bounded input, delay-tolerant, smoothness."""
    rates = {law: worst_ratio(runs, law, "tv_rate", "classical", "tv_rate") for law in LAWS}
    steps = {law: worst_ratio(runs, law, "max_step", law, "max_u") for law in LAWS}
    properties = {
        "no chattering": ("TV rate over classical's", rates),
        "observer-free": ("estimated signals", {law: estimated(runs, law) for law in LAWS}),
        "bounded input": ("growth of max |u|", {law: growth(runs, law) for law in LAWS}),
        "delay-tolerant": ("delay less classical's, s", tolerance(runs)),
        "smoothness": ("largest step over max |u|", steps),
    }
    evidence: list[Check | Beside] = []
    for name, (unit, values) in properties.items():
        for (column, law), mark in zip(COLUMNS.items(), MARKS[name], strict=True):
            sure = ", cannot fail" if (name, column) in CERTAIN else ""
            cell = f"{name}: {column}"
            what = f"{cell} (paper: {'+' if mark == '+' else '--'}), {unit}{sure}"
            plus = runs.check(name, what, values[law], sentence=cell)
            evidence.append(plus if mark == "+" else opposite(plus))
    for column, law in COLUMNS.items():
        if runs.values["strict"] <= steps[law] < runs.thresholds["smoothness"].limit:
            what = f"smoothness: {column}, at a limit of {runs.values['strict']:g} the mark would be --"
            evidence.append(Beside(what, steps[law]))
    return [*evidence, Beside(f"bounded input: {UNCLAMPED}, growth of max |u|", growth(runs, UNCLAMPED))]


def opposite(plus: Check) -> Check:
    """Return the check of a cell in which the paper has a minus."""
    return check(plus.what, plus.value, OPPOSITE[plus.relation], plus.limit, plus.sentence)


def worst_ratio(runs: Runs, law: str, metric: str, other: str, reference: str) -> float:
    """Return a metric of a law over a reference metric of another law, nominal, worst plant; inf if it is 0 / 0."""
    ratios = [ratio(runs.score(plant, law)[metric], runs.score(plant, other)[reference]) for plant in runs.plants]
    return math.inf if any(map(math.isnan, ratios)) else max(ratios)


def tolerance(runs: Runs) -> dict[str, float]:
    """Return law -> largest delay less classical's, s, worst plant."""
    longest = largest_delays(runs, runs.plants, LAWS)
    return {law: min(longest[p, law] - longest[p, "classical"] for p in runs.plants) for law in LAWS}


def growth(runs: Runs, law: str) -> float:
    """Return the growth of max |u| with distance or with time, whichever is larger, as a share; worst plant."""
    return max(_growth(runs.law(plant, law), scale(runs.scenario(plant, law))) for plant in runs.plants)


def _growth(law: Component, start: float) -> float:
    """Return the growth of a law's largest |u|, far off against nearer and late against early; start is |x0|."""
    samples = round(HELD / CONTROL_PERIOD)
    near, far = (np.abs(_asked(law, np.full(2 * samples, times * start))) for times in (10.0, 100.0))
    sooner = near[:samples].max()
    return max(ratio(far[:samples].max(), sooner), ratio(near.max(), sooner)) - 1.0


def estimated(runs: Runs, law: str) -> float:
    """Return how many signals, beside position and velocity, change what a law does."""
    bound = runs.law(runs.plants[0], law)
    x, v, other = np.random.default_rng(0).normal(size=(3, PROBES))
    plain = _asked(bound, x, v)
    return float(sum(np.any(_asked(bound, x, v, **{name: other}) != plain) for name in ESTIMATED))


def _asked(law: Component, x: np.ndarray, v: np.ndarray | None = None, **signals: np.ndarray) -> np.ndarray:
    """Return what a law commands, sample by sample, in open loop: the signals do not depend on its command."""
    function, gains, memory = (
        rebuild(law.function, lambda same: same),
        SimpleNamespace(**law.gains),
        np.zeros(law.memory),
    )
    seen = {"x": x, "e": x} | {name: np.zeros_like(x) if v is None else v for name in ("v", "de")} | signals
    u = np.empty(len(x))
    for k in range(len(x)):
        still = Measurement(
            t=k * CONTROL_PERIOD, dt=CONTROL_PERIOD, x=0.0, v=0.0, e=0.0, de=0.0, r=0.0, dr=0.0, ddr=0.0, f=0.0, g=1.0
        )
        u[k] = function(still._replace(**{name: float(values[k]) for name, values in seen.items()}), gains, memory)[0]
    return u
