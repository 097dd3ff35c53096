"""What a control law is: a pure function of one channel's measurement, its gains and its memory.

    @law_function(gains={"lam": 6.0, "k1": 3.0})
    def my_law(y, gains, memory):
        s = y.de + gains.k1 * y.e
        return -gains.lam * math.tanh(s), s        # commanded control before saturation, sliding variable

The law runs once per control sample; its u is clipped to +-limit and held. It never sees the simulator: what it knows
of the plant is the nominal f and g in its measurement.

Laws of this library are written in the wanted acceleration v of the error: `sliding` gives the sliding variable and the
acceleration that keeps it, and `command` turns v into u, with the nominal model where the scenario gives it to the law,
and as it stands where it does not (f = 0, g = 1).
"""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple, Unpack, overload

from numba import njit

from smc_mujoco.common.errors import ScenarioError, find, shown
from smc_mujoco.control.component import Component, LawOptions, Template, decorated, discover
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import catalogue as plants_known
from smc_mujoco.mechanisms.plant import plant as find_plant

Law = Component


class Measurement(NamedTuple):
    """What a law sees of its channel at a sample, SI units."""

    t: float  # time of the sample
    dt: float  # control period
    x: float  # measured position
    v: float  # measured or estimated velocity
    e: float  # x - r
    de: float  # v - r'
    r: float  # reference
    dr: float
    ddr: float
    f: float  # nominal f(x, v) of x'' = f + g u, at the measured x and v
    g: float
    a: float = 0.0  # estimated acceleration; r'' where the estimator gives none
    limit: float = math.inf  # bound on |u|: u_max, or what the channel's own motor gives
    model: float = 0.0  # 1 where the scenario lets its law use f and g
    surfaced: float = 0.0  # 1 where the scenario has a surface, and what it gives:
    s: float = 0.0  # sliding variable
    eq: float = 0.0  # acceleration of the error that keeps s constant
    q: float = 0.0  # of the joint that moves with this one without an actuator of its own: measured position,
    dq: float = 0.0  # velocity,
    fq: float = 0.0  # and nominal q'' = fq + gq u; all 0 without such a joint
    gq: float = 0.0


@njit
def sliding(y, c):
    """Return the sliding variable s, and the acceleration of the error that keeps it constant.

    Those of the scenario's surface, eq included whether the law has the model or not; or s = de + c e, for which
    eq = -c de: left out where the law has no model, as model-free laws are published without it.
    """
    if y.surfaced != 0.0:
        return y.s, y.eq
    return y.de + c * y.e, -y.model * c * y.de


@njit
def command(y, v):
    """Return the u that gives the error the acceleration v: (v - f + r'') / g with the model, v without."""
    if y.model == 0.0:
        return v
    return (v - y.f + y.ddr) / y.g


@njit
def input_gain(y):
    """Return g as the law may know it: nominal with the model, 1 without."""
    return y.g if y.model != 0.0 else 1.0


@njit
def sgn(a):
    """Return the sign of a; 0 at 0."""
    return math.copysign(1.0, a) if a != 0.0 else 0.0


@njit
def power(a, p):
    """Return [a]^p = |a|^p sgn(a), p > 0."""
    return math.copysign(abs(a) ** p, a) if a != 0.0 else 0.0


@overload
def law_function(function: Callable, /) -> Template: ...
@overload
def law_function(**options: Unpack[LawOptions]) -> Callable[[Callable], Template]: ...
def law_function(
    function: Callable | None = None, /, **options: Unpack[LawOptions]
) -> Callable[[Callable], Template] | Template:
    """Make a law of a function (y, gains, memory) -> (u, s).

    Args:
      gains: name -> default value, or a Gain that says its unit and range too. `smc.tune` needs the units.
      memory: floats of memory per channel. Default: 8.
      positive, nonnegative: gains that must be greater than 0, or at least 0; a Gain can say it itself.
      relative_degree: of the sliding variable that the law needs: 1, the default, or 2 and 3 for laws of e.
      conditions: what its theorem asks of the gains, in words -> whether gains satisfy it. A warning quotes the words.
      plants: names of the plants that it is for; empty: every one.
      requires_model: whether it cannot work without the nominal model, which a scenario then gives it by default.
      label: its name in figures and tables. Default: the function's name.
      short: its name in two or three letters. Default: initials.
      colour: "#RRGGBB". Default: one of a palette, always the same.
      rest: what linear theory needs to know, a `smc_mujoco.control.component.Rest`. Default: the law is not linear.

    The function must be pure: what it is to remember goes into memory, what is to vary into gains. Compiled, it keeps
    the globals and closed-over values that it was compiled with, and random numbers in it would come from a shared
    generator. Each new function object is compiled once and stays in memory, about 2.5 MB, because numba frees no code:
    give a gain other values instead of making a function for each. Ctrl-C does not stop a compiled law that never ends;
    kill the process. A compiled law that calls itself without end crashes the process.

    Returns:
      A decorator; the decorated function called with gains, `my_law(lam=5.0)`, gives the Law of a Scenario.
    """
    return decorated("law", function, options)


@functools.cache
def catalogue() -> dict[str, Template]:
    """Return every law found in smc_mujoco.control.laws, by name."""
    return discover("smc_mujoco.control.laws")


def checked_name(law: Law) -> Law:
    """Return the law; ScenarioError if it is a user's and has the name of one of the library."""
    known = catalogue().get(law.name) if law.kind == "law" else None
    if known is None or law.function in (None, known.function):
        return law
    raise ScenarioError(
        f"law {law.name!r} is yours and has the name of one of the library: call its function otherwise, or give "
        f"law.named('my_{law.name}')"
    )


def law(name: str, **gains: float) -> Law:
    """Return the law `name` of the library, with some gains changed. `law(...).named("slow")` gives it another name.

    Raises:
      ScenarioError: unknown law or gain, or a gain out of its range.
    """
    return find("law", name, catalogue()).bind(gains, warn=True)


def fits(law: Law | Template, plant: Plant) -> bool:
    """Return whether a law is for a plant: for every plant, for one of its name, or for models of its kind."""
    if not law.plants or plant.name in law.plants:
        return True
    known = [plants_known()[name] for name in law.plants if name in plants_known()]
    return plant.direct and plant.underactuated and any(each.underactuated for each in known)


def laws(plant: Plant | str | None = None) -> list[str]:
    """List the names that `law` knows; with a plant, of the laws that are for it.

    A law without `plants` of its own is for every plant whose channels all have an actuator; `none` for every plant;
    one for joints without an actuator for models of yours that have such joints too.
    """
    if plant is None:
        return list(catalogue())
    kind = find_plant(plant) if isinstance(plant, str) else plant
    if not isinstance(kind, Plant):
        raise ScenarioError(f"plant is {shown(kind)}: give smc.plant(...) or one of the names smc.plants() lists")
    return [
        name
        for name, template in catalogue().items()
        if fits(template, kind) and (template.plants or name == "none" or not kind.underactuated)
    ]
