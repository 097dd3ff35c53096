"""Controls of the problems: laws that are no entries.

- zero: u = 0, or of a quadrotor its weight, so that it stays in the air. It must reach no target of
  any problem.
- oracle: it is handed the state, and f and g of x'' = f + g u with the true parameters and with all
  other forces in f (a scenario's model "true"). It must reach every target. With the acceleration
  a = g limit - |f - r''| that is left, it goes to its goal on the parabola de^2 = 2 share a |e|,
  and near it as a critically damped pole of frequency w:

    u = (r'' - f - 2 w (de + h)) / g,   h = w e / 2 where |e| <= 2 share a / w^2,
                                        sgn(e) (sqrt(2 share a |e|) - share a / w) elsewhere

  Source: a proximate time-optimal servo, G. F. Franklin, J. D. Powell & M. L. Workman, Digital
  Control of Dynamic Systems, 2nd ed., Addison-Wesley 1990, section 11.3.

  Where a joint without an actuator moves with it, near upright q'' = b (x'' - fall q) with b = gq /
  g, and x'' is the state feedback that puts all four poles at -w (F. J. Ackermann, Regelungstechnik
  20:297, 1972).

  That of flight is in oracle_flight.py.
"""

import dataclasses
import itertools
import math
from collections.abc import Iterable

import numpy as np
from oracle_flight import knowing, oracle_flight

from smc_mujoco.control.from_text import law
from smc_mujoco.control.law import FREE_BODY, Law, law_function
from smc_mujoco.problems.problem import Problem
from smc_mujoco.simulation.scenario import Scenario

# plant -> fall, in m/s^2, or of a rotary arm 1/s^2: gravity over its length
FALL = {"cart_pole": 9.81, "furuta": 9.81 / 0.085}


@law_function(gains={"w": 20.0, "share": 0.5}, positive=("w", "share"), requires_model=True)
def oracle(y, gains, memory):
    """Return u and the distance to the parabola."""
    w = gains.w
    spare = gains.share * max(abs(y.g) * y.limit - abs(y.f - y.ddr), 0.05 * abs(y.g) * y.limit)
    h = 0.5 * w * y.e
    if abs(y.e) > 2.0 * spare / (w * w):
        h = math.copysign(math.sqrt(2.0 * spare * abs(y.e)) - spare / w, y.e)
    s = y.de + h
    return (y.ddr - y.f - 2.0 * w * s) / y.g, s


@law_function(gains={"w": 4.0, "fall": 9.81}, positive=("w", "fall"), requires_model=True)
def oracle_pair(y, gains, memory):
    """Return u and the acceleration that a joint with an actuator is given, so that its partner
    stands, too.
    """
    w = gains.w
    b = y.gq / y.g  # of the partner's acceleration, over the joint's; the rest is its fall
    a = -b * gains.fall
    k1 = w**4 / a
    k2 = 4.0 * w**3 / a
    k3 = -(6.0 * w * w + k1 + a) / b
    k4 = -(4.0 * w + k2) / b
    s = k1 * y.e + k2 * y.de + k3 * y.q + k4 * y.dq
    return (y.ddr - y.f + s) / y.g, s


@law_function(joint=True, requires_model=True, plants=(FREE_BODY,))
def hover(y, gains, memory):
    """Return the weight, and the error."""
    u = np.zeros(6)
    u[:3] = y.h[:3]
    return u, y.e


ORACLES = oracle.function, oracle_pair.function, oracle_flight.function


def oracle_of(plant: str, w: float, share: float) -> Law:
    """Return the oracle for a plant; that of a pair of joints has no share, and that of flight a
    time in its place.
    """
    if plant == "quadrotor":
        return oracle_flight(w=w, move=share)
    if plant in FALL:
        return oracle_pair(w=w, fall=FALL[plant])
    return oracle(w=w, share=share)


def zero(plant: str) -> Law:
    """Return the law that does nothing on a plant."""
    return (hover() if plant == "quadrotor" else law("none")).named("zero")


def informed(scenario: Scenario) -> Scenario:
    """Return a scenario that hands the truth to an oracle; the same one under any other law."""
    if not any(part.function in ORACLES for part in scenario.law.parts):
        return scenario
    if scenario.plant.pose:
        return knowing(scenario)
    return dataclasses.replace(scenario, model="true", noise=None, sensor=None, velocity=None)


def scenarios(
    one: Problem, law: Law, instances: str | Iterable[int] = "visible", seed: int = 0
) -> list[Scenario]:
    """Return the scenarios of a control, as `Problem.scenarios` of a law."""
    if isinstance(instances, str):
        instances = range(one.visible)
    base = one._base(law)
    runs = []
    for index in instances:
        scenario = informed(one._place(base, one.instance(index, seed)))
        if one._attacked:
            scenario = informed(one._worst(scenario))
        runs.append(scenario)
    return runs


def oracles(one: Problem) -> Iterable[tuple[float, float]]:
    """Return the bandwidths, rad/s, and shares, or times of its move, from which the oracle's are
    chosen.
    """
    return itertools.product(one._values["bandwidths"], one._values["shares"])


def frozen(one: Problem) -> dict[str, Law]:
    """Return the controls of a problem with targets: "zero", which reaches none of them, and
    "oracle", which reaches all.
    """
    return {"zero": zero(one.plant), "oracle": oracle_of(one.plant, *one._frozen["oracle"])}
