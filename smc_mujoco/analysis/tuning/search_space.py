"""Search space of gains: one rule for every law, by dimensional analysis of the plant.

The plant has four scales, from which each gain's scale follows:

    X = max |x0|        position, rad or m
    F = u_max           force, N m or N
    M = 1 / g(0)        inertia, kg m^2 or kg; of the driven joints, where others are free
    T = sqrt(M X / F)       s, time in which the actuator moves the plant from rest by X / 2

A gain with the unit F^a X^b T^c is searched in log space over its scale times 10^-1.5 .. 10^1.5,
and a search may leave this box by a decade, or by a decades if a > 1: the slopes of a regulator are
roots of its weights in N^2/m^2. As F = M X / T^2, its unit has 2 a - c powers of a rate 1 / T. A
force or a stiffness has two, and each beyond two, or beyond those of F^a if a > 1, raises the upper
end by a decade. So ki of a PID, N/(m s), reaches the l wc^2 / b that is the integral of a PD with
an observer. Forces have this box too, such as lambda of -lambda tanh(s), as the actuator clips the
command of every law alike. A law with 1 / tau in place of k has the same search. A law may divide a
gain by another one, such as k by b in the force k / b, where b is an estimate of g. Then k / b is
searched as far as a force, for the b of each candidate. The law declares this with `Gain(2.0,
ACCELERATION, over="b")`.

Where u is a voltage or an acceleration, F is its bound and g is x'' per unit of u; of the set-point
of a servo, F ends where its force does. No loop uses a force that moves the plant by X / 2 before
u answers to it: of a stronger actuator F is the one for which T is the longest delay of u in the
conditions. X is the largest |x0| of all joints, also of free ones, in m and in rad alike.

A user's model has no such g in general. There X is the largest distance from the goal, g is that of
MuJoCo at the start (see `mechanisms.custom.scales`), and F at most 100 times what the joint needs.

A free body has these scales twice, as its forces and torques differ: of its position, with X the
largest distance from rest at the start, and of its attitude, with X = 1 rad, since it tilts to move
wherever it starts. A gain that is declared with `turns=True` is of the attitude.

A law declares the unit of each gain, and which gains the search leaves as they are: initial values,
exponents, table sizes, a plant's parameters, filters and number formats of a processor. A gain that
a law was given as 0 stays 0, which says what terms the law has. A gain of unknown unit is searched
over as many decades about its default:

    gains = {"lam": Gain(6.0, FORCE), "k1": Gain(2.5, RATE), "order": Gain(2.0, held=True)}
    @smc.law_function(gains=gains)

Some laws contain a number with a unit, such as the width 1 of tanh(s): their gains have the units
that leave this number unchanged. A law that takes g as 1 treats forces and accelerations in the
same way; one that needs the nominal model declares which of both a gain is.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from smc_mujoco.common.aliases import Numbers, Pair
from smc_mujoco.common.errors import ScenarioError, warn_once
from smc_mujoco.common.text import number
from smc_mujoco.control import source
from smc_mujoco.control.component import Component, unit_cure
from smc_mujoco.control.units import FORCE, Gain, Unit
from smc_mujoco.mechanisms.custom import scales as at_start
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.grid import SPREAD, START_CURE
from smc_mujoco.simulation.scenario import Scenario

HALF_WIDTH = 1.5  # decades on either side of the scale of a force or a rate: chosen
BOUND_MARGIN = 0.02  # of the range in log space: a gain so close to a bound counts as at the bound
WIDENING = 1.0  # decades by which the search may leave the box
OF_TURNS = " of turns"  # at the end of the names of an attitude's scales
ROUNDING_TOLERANCE = 1e-3  # of a gain: twice the largest error of four digits

Box = Mapping[str, tuple[float, float]]  # gain -> lowest, highest


def _gain(law: Component, name: str) -> Gain:
    """Return a law's gain with its unit, which may depend on the law's exponents."""
    declared = law.template.gains if law.template else {}
    gain = declared.get(name, Gain(law.gains[name]))
    return dataclasses.replace(gain, unit=gain.unit_at(law.gains))


def unit(law: Component, name: str) -> Unit | None:
    """Return the unit of a law's gain; None for a gain that is not searched and has none."""
    gain = _gain(law, name)
    if gain.unit is None and not gain.held:
        raise ScenarioError(
            f"tuning knows no unit of {law.name}'s gain {name!r}: {unit_cure(name, gain.default)}"
        )
    return gain.unit  # pyright: ignore[reportReturnType]


def without_unit(law: Component) -> dict[str, float]:
    """Return gain -> default of the searched gains whose unit is not known."""
    defaults = {}
    for name in law.gains:
        gain = _gain(law, name)
        if gain.unit is None and not gain.held:
            defaults[name] = gain.default
    return defaults


def unit_texts(law: Component, names: Sequence[str], scenario: Scenario) -> dict[str, str]:
    """Return gain -> its unit in words in a scenario, "1" for one without a unit or of unknown
    unit.

    A gain that several channels share has the unit of the first that it belongs to.
    """
    texts = {}
    for name in names:
        gain = _gain(law, name)
        channel = 3 if gain.turns else 0
        unit = gain.unit if isinstance(gain.unit, Unit) else Unit()
        unit_of_x = scenario.plant.units[channel]
        texts[name] = unit.text(scenario.efforts[channel], unit_of_x)
    return texts


def _scales_of(gain: Gain, scales: Numbers) -> Numbers:
    """Return F, X and T of the channels that a gain is of; of a plant without a pose there is one
    set.
    """
    sizes = {}
    for name in ("F", "X", "T"):
        own_name = name + OF_TURNS * gain.turns
        sizes[name] = scales.get(own_name, scales[name])
    return sizes


def scales(
    plant: Plant,
    u_max: float,
    reach: float | None = None,
    per_u: float | None = 1.0,
    late: float = 0.0,
) -> dict[str, float]:
    """Return the plant's X, F, M and T in SI units.

    Those of a free body's attitude have names that end in OF_TURNS.

    Args:
      plant: of which g is taken.
      u_max: bound on u.
      reach: X, rad or m; by default max |x0| of the plant.
      per_u: force per unit of u, N m/V or N/V; None: u is an acceleration.
      late: the least T, s: how late u answers to a position.
    """
    if plant.pose and plant.by_mujoco:
        start = np.array(plant.x0)
        still = np.zeros(plant.n)
        M = plant.nominal.dynamics(start, still, plant.values({})).M
        limits = plant.limits
        force = min([u_max, *limits[:3]])
        torque = min([u_max, *limits[3:6]])
        most = max(np.diag(M)[3:])
        of_turns = _scales(1.0 / most, torque, 1.0)
        room = SPREAD if reach is None else reach
        own = _scales(1.0 / M[0, 0], force, room)
        for name, value in of_turns.items():
            own[name + OF_TURNS] = value
        return own
    if reach is None:
        X = max(abs(x - r) for x, r in zip(plant.x0, plant.origin, strict=True))
    else:
        X = reach
    if plant.is_user_model and per_u is not None:
        # a bound far beyond what the joint needs is no scale
        need = max(at_start.needs(plant))
        if u_max * per_u > at_start.MOST * need:
            times = number(u_max * per_u / need)
            warn_once(
                f"{plant.name} may give {u_max * per_u:g}, {times} times what it needs to move and "
                f"to hold ({need:g}), and friction and other conditions are sized by it: if the "
                "number of its file is a placeholder, give the motor's, as elbow(u_max=9) or "
                "smc.Channel(u_max=9)"
            )
            u_max = at_start.MOST * need / per_u
        g = min(at_start.mobility(plant, u_max * per_u, X))
    else:
        zeros = np.zeros(plant.n)
        values = plant.values({})
        g = min(abs(plant.nominal(zeros, zeros, i, values)[1]) for i in range(plant.driven))
    g = 1.0 if per_u is None else g * per_u
    if not X > 0.0:
        raise ScenarioError(
            f"{plant.name} starts at 0, where a law has nothing to do: {START_CURE}"
        )
    if not (math.isfinite(g) and g > 0.0):
        raise ScenarioError(
            f"{plant.name} has g(0) = {g:g}: tuning needs a joint that u moves; choose another "
            "plant"
        )
    return _scales(g, min(u_max, X / (g * late**2)) if late else u_max, X)


def _scales(g: float, u_max: float, X: float) -> dict[str, float]:
    """Return the scales of channels with this g, bound on u and X."""
    time = math.sqrt(X / (g * u_max))
    return {"X": X, "F": u_max, "M": 1.0 / g, "T": time}


def left_out(law: Component, name: str) -> bool:
    """Return whether a gain was given as 0, which leaves out a term of the law."""
    return law.source.kind != source.DEFAULT and law.gains[name] == 0.0


def box(law: Component, plant_scales: Numbers) -> dict[str, Pair]:
    """Return gain -> lowest and highest start of the search, for all gains of a law that are
    searched.
    """
    bounds = {}
    if not law.uniform:
        raise ScenarioError(
            f"tuning needs gains that all channels share, not {law}: give one number for each gain"
        )
    defaults = without_unit(law)
    for name in law.gains:
        if name in defaults:
            if not defaults[name] > 0.0:
                unit(law, name)  # raises: there is neither a unit nor a size
            default = defaults[name]
            bounds[name] = (default * 10**-HALF_WIDTH, default * 10**HALF_WIDTH)
        elif (gain_unit := unit(law, name)) is not None and not (
            _gain(law, name).held or left_out(law, name)
        ):
            scale = gain_unit.of(_scales_of(_gain(law, name), plant_scales))
            usual = FORCE.rates * max(1.0, gain_unit.force)
            above = HALF_WIDTH + max(0.0, gain_unit.rates - usual)
            bounds[name] = (scale * 10**-HALF_WIDTH, scale * 10**above)
    if not bounds:
        raise ScenarioError(f"law {law.name!r} has no gain to tune: choose another")
    return bounds


def at_bound(gains: Numbers, bounds: Box) -> dict[str, str]:
    """Return gain -> "lower" or "upper" for gains within 2 % of a bound in log space."""
    edges = {}
    for name, (low, high) in bounds.items():
        width = math.log(high / low)
        place = math.log(gains[name] / low) / width
        if min(place, 1.0 - place) <= BOUND_MARGIN:
            edges[name] = "lower" if place < 0.5 else "upper"
    return edges


def edges_in_words(gains: Numbers, edges: Mapping[str, str]) -> list[str]:
    """Return a sentence for each gain that is at the edge of where it was searched, `edges` being
    what `at_bound` returns.
    """
    beyond = {"lower": "smaller", "upper": "larger"}
    sentences = []
    for name, side in edges.items():
        place = f"{name} = {gains[name]:.4g} is at the {side} end of where it was searched"
        sentences.append(f"{place}: a {beyond[side]} one may be better")
    return sentences


def force_limits(law: Component, gains: Numbers, u_max: float) -> dict[str, float]:
    """Return the largest value of each gain k that the law divides by another one, b: that of a
    force, times b.
    """
    declared = law.template.gains if law.template else {}
    values = {**law.gains, **gains}
    largest = u_max * 10 ** (HALF_WIDTH + WIDENING)
    limits = {}
    for name, gain in declared.items():
        if gain.over is not None:
            limits[name] = largest * values[gain.over]
    return limits


def widened(law: Component, bounds: Box) -> dict[str, Pair]:
    """Return bounds a decade wider on either side, and a times as many of a gain in F^a, a > 1."""
    wider = {}
    for name, (low, high) in bounds.items():
        gain_unit = _gain(law, name).unit
        powers = gain_unit.force if isinstance(gain_unit, Unit) else 1.0
        factor = 10 ** (WIDENING * max(1.0, powers))
        wider[name] = (low / factor, high * factor)
    return wider
