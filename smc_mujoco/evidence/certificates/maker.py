"""Certificates of laws on plants: which theorem holds, by which margins, from where, and how far d
can push.

    scenario = smc.Scenario(plant="duffing", law="observer_free")
    certificate = smc.audits.certify(scenario, within=smc.Uncertainty(disturbance=1.0))
    certificate.bound                      # |x| in the end, m, under every |d| <= 1 N
    certificate.save("duffing.json")       # smc-mujoco certify --check duffing.json proves it again

The plant is its equation M x'' = phi(x) - D(x) x' + u + d, integrated exactly, and the law acts at
every instant. No theorem here is about what else a machine does.
"""

import dataclasses
import functools
import itertools
import math
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np

from smc_mujoco.common.aliases import Fields, Pair
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.extras import extra
from smc_mujoco.evidence.certificates import search
from smc_mujoco.evidence.certificates.certificate import Certificate, finite, holds
from smc_mujoco.evidence.certificates.loops import Loop, loop_of
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.robustness.uncertainty import Uncertainty
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Constant, bounds_of

MARGIN_SHARE = 1e-4  # share by which a margin is stated below the true one
BOX_COUNTS = (64, 256, 1024, 4096)  # tried in turn
SET_FACTOR = 0.98  # factor on the largest set that a condition allows: chosen
# where a law has them, its theorems need them > 0
POSITIVE_GAINS = ("lam", "k", "k1", "c", "phi", "q1")
LAWS = ("observer_free", "boundary_layer", "lqr", "classical")
# theorem, its data -> its margins, None where it is refused
Judge = Callable[[str, dict], dict[str, Any] | None]
PLANTS = (
    "inverted_pendulum",
    "duffing",
    "van_der_pol",
    "pendulum_network",
    "inverted_pendulum_network",
)


def certify(scenario: Scenario, within: Uncertainty | None = None) -> Certificate:
    """Return what is proven of a scenario's law on its plant, checked in ball arithmetic.

    Laws: observer_free, boundary_layer, lqr, classical; all without the nominal model or a separate
    surface. Plants: the pendulums and their networks, duffing and van_der_pol, with any parameters
    and mismatch, and with 0 as the goal.

    Args:
      within: disturbances in addition to those of the scenario, a bound of |d|; None: no other.

    Raises:
      ScenarioError: a pair for which there is no theorem, a disturbance without a bound, or a class
        with more than disturbances.
      MissingPackageError: python-flint is not installed.
    """
    with extra("proof", "smc.audits.certify"):
        import flint  # noqa: F401

        from smc_mujoco.evidence.certificates import checker
    if not isinstance(scenario, Scenario):
        raise ScenarioError(
            f"certify is about a Scenario, not {shown(scenario)}: give smc.Scenario(...)"
        )
    _check(scenario)
    plant = scenario.plant
    law = scenario.law
    d0 = _bound(scenario)
    if within is not None:
        d0 += _class(within, plant)
    values = vars(plant.values(scenario.mismatch))
    document: Fields = {
        "format": checker.FORMAT,
        "plant": {
            "name": plant.name,
            "n": plant.n,
            "parameters": {name: float(value) for name, value in values.items()},
            "mechanism": scenario.mechanism,
        },
        "law": {
            "name": law.name,
            "gains": {name: finite(value) for name, value in law.gains.items()},
        },
        "u_max": finite(scenario.limits[0]),
        "unit": plant.unit,
        "disturbance": d0,
    }
    document["parts"] = _parts(document, scenario, checker)
    document["seal"] = checker.seal(document)
    certificate = Certificate(data=document)
    certificate.check()
    return certificate


def _check(scenario: Scenario) -> None:
    """Raise ScenarioError for a scenario that no theorem here is about."""
    plant = scenario.plant
    law = scenario.law
    if (
        law.name not in LAWS
        or law.function is None
        or plant.name not in PLANTS
        or plant.is_user_model
    ):
        raise ScenarioError(
            f"there is no theorem for {law.name} on {plant.name}: certify one of {', '.join(LAWS)} "
            f"on one of {', '.join(PLANTS)}"
        )
    zero = [name for name in POSITIVE_GAINS if law.uniform and law.gains.get(name, 1.0) <= 0.0]
    refused = {
        f"{law.name} with {' and '.join(zero)} not above 0": zero,
        "model='nominal'": scenario.resolved.model != "none",
        "a surface": scenario.surface is not None,
        "a feedforward": scenario.feedforward is not None,
        "a reference that is not 0": any(r != Constant(0.0) for r in scenario.references),
        "gains or bounds by channel": not law.uniform or len(set(scenario.limits)) > 1,
        "a motor's voltage as u": any(part.unit for part in scenario.actuator),
        "an acceleration as u": scenario.accelerates,
        f"mechanism {scenario.mechanism!r}": scenario.mechanism != "equation" and plant.n == 1,
    }
    for what, there in refused.items():
        if there:
            raise ScenarioError(f"there is no theorem for {what}: certify a scenario without it")


def _bound(scenario: Scenario) -> float:
    """Return the bound of |d| of a scenario's disturbance."""
    total = 0.0
    for signal in scenario.disturbance:
        bounds = bounds_of(signal)
        if bounds is None:
            raise ScenarioError(
                f"{type(signal).__name__} has no bound: leave it out, and give "
                "within=smc.Uncertainty(disturbance=...)"
            )
        total += bounds[0]
    return total


def _class(within: Uncertainty, plant: Plant) -> float:
    """Return the bound of |d| of a class."""
    if not isinstance(within, Uncertainty):
        raise ScenarioError(
            f"within is {shown(within)}: give a class, such as smc.Uncertainty(disturbance=2.0)"
        )
    if dataclasses.replace(within, disturbance=1.0) != Uncertainty(disturbance=1.0):
        raise ScenarioError(
            f"within has {within.words(plant)}, and a certificate knows a bound of d alone: give "
            "smc.Uncertainty(disturbance=...)"
        )
    return within.disturbance


def _parts(document: dict, scenario: Scenario, checker: Any) -> list[dict]:
    """Return the theorems of a law on a plant with their data."""
    loop, terms, law = loop_of(document)
    e = checker.equation(document["plant"])
    f = checker.feedback(document["law"], document["u_max"])

    def judge(theorem: str, data: dict) -> Fields | None:
        """Return the margins of a theorem's conditions, or None if the checker refuses the data."""
        try:
            derived = checker.THEOREMS[theorem](document, data, e, f)
            return {name: value and value[0] for name, value in derived.items()}
        except checker.Refused:
            return None

    def attracts(P: np.ndarray) -> bool:
        try:
            checker.quadratic([P[0, 0], P[0, 1], P[1, 1]], e, f, ())
        except checker.Refused:
            return False
        return True

    parts = [_saturated(document, loop, terms, law, judge)]
    if document["plant"]["n"] > 1:
        return parts
    if scenario.plant.unit == "rad":
        reach = math.pi
    else:
        reach = 3.0 * max(map(abs, scenario.plant.x0))  # chosen
    box = None
    if law.name == "classical":
        reaching = _reaching(0.5 * loop.c, reach, judge)
        box = reaching["X"], reaching["S"]
        parts.append(reaching)
    bounded = document["disturbance"] > 0.0 or not parts[0]["holds"]
    if bounded:
        x0 = scenario.resolved.x0[0]
        v0 = scenario.resolved.v0[0]
        start = x0, v0 + loop.c * x0
        proven = functools.partial(checker.falls, e, f, checker.arb(document["disturbance"]))
        if levels := search.levels(loop, reach, start, proven, attracts, box):
            parts.append(_levels(float(f.room[0]), levels, (x0, v0), start))
    return parts


def _part(theorem: str, margins: Fields, **data: Any) -> dict:
    """Return a theorem as data, with the margins of its conditions by name."""
    conditions = []
    for name, value in margins.items():
        conditions.append({"name": name, "margin": float(value)})
    proven = all(holds(one["name"], one["margin"]) for one in conditions)
    return {"theorem": theorem, "holds": proven, "conditions": conditions} | data


def _judged(theorem: str, data: dict, judge: Judge) -> dict:
    """Return a theorem with the margins that the checker derives from its data; data refused here
    are refused again in the end.
    """
    return _part(theorem, judge(theorem, data) or {}, **data)


def _saturated(
    document: dict, loop: Loop, terms: list[float], law: SimpleNamespace, judge: Judge
) -> dict:
    """Return the theorem of a saturated PD law: V and its conditions."""
    A, B, C, _, _ = terms
    force = loop.steep  # of a law without a bound of its own
    if law.name == "observer_free":
        force = law.lam
    elif law.name != "lqr":
        force = law.k
    V = {
        "v^2": loop.M / 2.0,
        "sigma": force / loop.c,
        "cos x - 1": A,
        "x^2": -B / 2.0,
        "x^4": -C / 4.0,
    }
    V["springs"] = document["plant"]["parameters"].get("kc", 0.0) / 2.0
    for condition in _restoring(loop, terms):
        if margins := judge("saturated PD", {"V": V, "conditions": [None, condition]}):
            part = _part("saturated PD", margins | {"restoring": condition["margin"]}, V=V)
            part["conditions"][1] = condition
            return part
    raise ScenarioError(
        "found no boxes that prove that the law is stronger than the plant: give other gains"
    )


def _restoring(loop: Loop, terms: list[float]) -> Iterator[dict]:
    """Yield the condition that the law's force exceeds the plant's, with ever more boxes from 0 to
    infinity.
    """
    A, B, C, _, _ = terms
    tail = 1.0
    if C < 0.0:
        tail = math.sqrt(max(B, 0.0) / -C) * 1.01 + 0.1
    if A:
        tail = max(tail, 2.0 * math.pi)
    x = np.linspace(0.0, 2.0 * tail, 20001)[1:]
    share = 1.0 - loop.phi(x) / loop.sigma(loop.c * x)
    smallest = min(1.0, float(share.min()))
    if not loop.switches:
        smallest = min(smallest, 1.0 - (A + B) / (loop.steep * loop.c))
    if smallest < 0.0 or C > 0.0 or (C == 0.0 and B > 0.0):
        at = float(x[share.argmin()])
        if share.min() >= 0.0:
            at = _far(loop)
        yield {"name": "restoring", "margin": _share(loop, at), "at": at}
        return
    margin = smallest
    if smallest < 1.0:
        margin -= MARGIN_SHARE * max(abs(smallest), 0.1)
    for count in BOX_COUNTS:
        edges = [float(f"{edge:.9g}") for edge in tail * np.linspace(0.0, 1.0, count + 1) ** 2]
        boxes = [*map(list, itertools.pairwise(edges)), [edges[-1], None]]
        yield {"name": "restoring", "margin": margin, "boxes": boxes}


def _far(loop: Loop) -> float:
    """Return an x where the plant's force is larger than the law's, for a plant whose force grows
    without bound.
    """
    x = 1.0
    while _share(loop, x) >= 0.0:
        x *= 2.0
    return x


def _share(loop: Loop, x: float) -> float:
    return 1.0 - float(loop.phi(np.array(x))) / float(loop.sigma(np.array(loop.c * x)))


def _reaching(lean: float, reach: float, judge: Judge) -> dict:
    """Return the largest set |x| <= X, |s| <= lean X where s = 0 is surely reached; X = 0 if there
    is none.
    """

    def reached(X: float) -> bool:
        return judge("reaching", {"X": X, "S": lean * X}) is not None

    X = SET_FACTOR * search.largest(reached, 0.0, reach)
    return _judged("reaching", {"X": X, "S": lean * X}, judge)


def _levels(room: float, levels: search.Levels, at: Pair, start: Pair) -> dict:
    """Return the levels of W as data; `at`, `start`: x and v, and x and s, at the start."""
    margins = {"actuator": room, "start": levels.outer - _cell(levels, *start)}
    data = {"x": levels.x.tolist(), "s": levels.s.tolist(), "W": levels.W.tolist()}
    data |= {"start": list(at), "inner": levels.inner, "outer": levels.outer}
    if levels.P:
        data["P"] = list(levels.P)
    return _part("level sets", margins, **data, bound=levels.bound)


def _cell(levels: search.Levels, x: float, s: float) -> float:
    """Return the largest W at the corners of a state's cell, 1 outside of the grid."""
    if x < 0.0:
        x = -x
        s = -s
    if x >= levels.x[-1] or abs(s) >= levels.s[-1]:
        return 1.0
    i = int(np.searchsorted(levels.x, x, side="right")) - 1
    j = int(np.searchsorted(levels.s, s, side="right")) - 1
    return float(levels.W[i : i + 2, j : j + 2].max())
