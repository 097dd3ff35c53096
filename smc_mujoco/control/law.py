"""Control laws: pure functions of one channel's measurement, of gains and of a memory.

    @law_function(gains={"lam": 6.0, "k1": 3.0})
    def my_law(y, gains, memory):
        s = y.de + gains.k1 * y.e
        return -gains.lam * math.tanh(s), s  # command before saturation, sliding variable

The law runs once per control sample. Its u is clipped to +-limit and stays until the next sample. A
law knows nothing of the simulator, and nothing of the plant except the nominal f and g in its
measurement.

The laws of this library compute a desired acceleration v of the error. `sliding` returns the
sliding variable and the acceleration that keeps it constant. `command` converts v to u: with the
nominal model if the scenario gives it to the law, otherwise with f = 0 and g = 1.
"""

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, Unpack, overload

from numba import njit

from smc_mujoco.common.errors import ScenarioError, find
from smc_mujoco.common.registry import Catalogue, catalogue_of
from smc_mujoco.control import estimator, surface
from smc_mujoco.control.component import FREE_BODY, Component, Options, Template, decorated
from smc_mujoco.control.measurement import Measurement  # noqa: F401
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.mechanisms.plant import plant_catalogue as plants_known

Law = Component


@njit
def sliding(y, c):
    """Return the sliding variable s, and v_eq, the acceleration of the error that keeps s constant.

    Both are those of the scenario's surface, with the model and without. If the scenario has no
    surface, s = de + c e. Then v_eq is -c de with the model and 0 without, because model-free laws
    are published without this term.
    """
    if y.has_surface != 0.0:
        return y.s, y.v_eq
    return y.de + c * y.e, -y.model * c * y.de


@njit
def command(y, v):
    """Return the u for the acceleration v of the error: (v - f + r'') / g with the model, v
    without.
    """
    if y.model == 0.0:
        return v
    return (v - y.f + y.ddr) / y.g


@njit
def input_gain(y):
    """Return g as the law knows it: nominal with the model, 1 without."""
    return y.g if y.model != 0.0 else 1.0


@njit
def per_command(y, b):
    """Return how fast a law's command changes s' before `command` divides it by g: 1 with the
    model, the assumed input gain b without.
    """
    return b if y.model == 0.0 else 1.0


@njit
def assumed(y, b):
    """Return the input gain and the known acceleration of an observer: g and f - r'' with the
    model, b and 0 without.
    """
    if y.model == 0.0:
        return b, 0.0
    return y.g, y.f - y.ddr


@njit
def clipped(y, u):
    """Return u within its bounds."""
    return min(max(u, -y.limit), y.limit)


@njit
def excess(y, u):
    """Return the acceleration that the bounds of u take away, g (sat(u) - u)."""
    return input_gain(y) * (clipped(y, u) - u)


@njit
def linear_plant(y, a1, a2, b):
    """Return a1, a2, b of the plant e'' = a1 e + a2 de + b u that a law of the linear theory takes.

    They are the law's gains; 0, 0, 1 with the model, which cancels f and g, and where no plant gave
    them.
    """
    if y.model != 0.0 or b == math.inf:
        return 0.0, 0.0, 1.0
    return a1, a2, b


@njit
def sgn(a):
    """Return the sign of a, with sgn(0) = 0."""
    return math.copysign(1.0, a) if a != 0.0 else 0.0


@njit
def power(a, p):
    """Return [a]^p = |a|^p sgn(a), p > 0."""
    if a != 0.0:
        return math.copysign(abs(a) ** p, a)
    return 0.0


@overload
def law_function(function: Callable[..., Any], /) -> Template: ...
@overload
def law_function(**options: Unpack[Options]) -> Callable[[Callable[..., Any]], Template]: ...
def law_function(
    function: Callable[..., Any] | None = None, /, **options: Unpack[Options]
) -> Callable[[Callable[..., Any]], Template] | Template:
    """Turn a function (y, gains, memory) -> (u, s) into a law.

        @smc.law_function(gains={"k": 3.0, "c": 2.0})
        def relay(y, gains, memory):
            s = y.de + gains.c * y.e
            return -gains.k * np.sign(s), s

    `y` is the measurement of one joint: y.e = x - r is the error, rad or m, y.de = v - r' its rate,
    y.x and y.v position and velocity, y.dt the control period, and more, see
    `help("smc_mujoco.control.measurement")`. `smc.exchange.law_from_control` has r - x for an
    error. A helper that the law calls needs @numba.njit above its def, or the law runs in slow
    Python.

    Args:
      gains: name -> default value, or a Gain with unit and range, which `smc.tune` needs, such as
        Gain(4.0, RATE, positive=True) for the slope of a surface. Gain and the units are in
        `smc_mujoco.control.units`, whose docstring lists them.
      memory: floats of memory per channel, 1 or more. Default: 8.
      positive, nonnegative: names of gains that must be above 0, or at least 0, as a Gain can say.
      relative_degree: of the sliding variable that the law needs: 1, the default, 2 or 3 (of e).
      conditions: condition of the theorem, in words -> function of the gains, read by attribute,
        that tests it. A warning quotes the words, tuning stays within, and results of other gains
        are marked "outside its theorem".
      advice: the same for conditions that only warn.
      plants: names of the plants that the law is for, or "a free body". Default: all plants.
      requires_model: whether the law needs the nominal model. A scenario then gives it by default.
      label: name in figures and LaTeX; other tables have the function's, which is the default.
      short: name in two or three letters. Default: initials.
      colour: "#RRGGBB". Default: a colour of a palette, always the same.
      linear_part: a `smc_mujoco.control.component.LinearPart`, of laws linear near s = 0.
      family: one word, such as "terminal", by which lists group the laws. With "baseline" figures
        do not draw what the law returns for s, because it has none.
      continuous: whether u is a continuous function of the measurement at s = 0 (at e = 0 for laws
        of e), however short the control period. Default: no.
      finite_time: what is 0 after a finite time by the law's theorem, without a disturbance: "e",
        the error; "s", the sliding variable, so that e then decays as on the surface; "", the
        default, neither.
      accuracy: "s" and "e" -> theory's order of accuracy: sampled with the control period h, under
        a disturbance that the law's theorem admits, |s| and |e| end below a multiple of h to this
        power. 0: below a bound that h does not change. A number, or a function of the gains, read
        by attribute; one without a name is for both. `smc.accuracy.orders` measures the orders.
      admits: "d" and "d'" -> function of the gains, read by attribute, that returns the bound below
        which |d|, N or N m, and |d'| must stay in the law's theorem. `smc.worst_case` says where a
        class goes beyond it.
      joint: whether it is a law of many joints: the function then gets the measurement of all
        channels, a `smc_mujoco.control.joint_law.JointMeasurement`, and returns two vectors u and
        s, one number for each channel.

    The function must be pure: state belongs in memory, parameters in gains. A compiled function
    keeps the values that its globals and closure had at compilation, and its random numbers would
    come from a shared generator. Each new function object is compiled once and occupies about 2.5
    MB until the process ends, so change a gain instead of defining a function per value. A compiled
    law that never returns keeps a core busy until Python ends, also after Ctrl-C, and one with
    endless recursion crashes the process.

    Returns:
      A decorator. The decorated function, called with gains as in `my_law(lam=5.0)`, returns the
      Law of a Scenario.
    """
    return decorated("law", function, options)


@functools.cache
def law_catalogue() -> Catalogue[Template]:
    """Return every law of smc_mujoco.control.laws and of other packages, by name."""
    return catalogue_of(
        "smc_mujoco.control.laws",
        Template,
        "smc_mujoco.laws",
        lambda law: law.kind == "law" and not law.joint,
    )


@functools.cache
def joint_law_catalogue() -> Catalogue[Template]:
    """Return every law of smc_mujoco.control.joint_laws and of other packages, by name."""
    return catalogue_of(
        "smc_mujoco.control.joint_laws",
        Template,
        "smc_mujoco.joint_laws",
        lambda law: law.kind == "law" and law.joint,
    )


@functools.cache
def all_laws() -> Catalogue[Template]:
    """Return every law of one channel and of many joints, by name."""
    return law_catalogue() | joint_law_catalogue()


def checked_name(law: Law) -> Law:
    """Return the law. Raise ScenarioError if it is a user's with the name of a law of the
    catalogue.
    """
    namesake = all_laws().get(law.name)
    if namesake is None or law.function is None:
        return law
    # module and name stay the same when the module is loaded again
    names = set()
    for f in (law.function, namesake.function):
        names.add((getattr(f, "__module__", ""), getattr(f, "__qualname__", f)))
    if len(names) == 1:
        return law
    package = all_laws().package(law.name)
    if package:
        owner = f"package {package!r}"
    else:
        owner = "the library"
    raise ScenarioError(
        f"your law {law.name!r} has the name of a law of {owner}: "
        f"rename its function, or give law.named('my_{law.name}')"
    )


def library_law(name: str, /, **gains: float | Sequence[float]) -> Law:
    """Return the library's law `name` with these gains: one number for all channels, or one for
    each driven channel.
    """
    return find("law", name, all_laws()).bind(gains, warn=True)


def suits(law: Law | Template, plant: Plant) -> bool:
    """Return whether a law is for a plant: for all plants, for this one, or for user's models of
    the same kind.

    A template with gains of the plant's linearisation is for plants that have one. A law without
    code, as a loaded trace may name, is taken to suit.
    """
    if law.function is None:
        return True
    if isinstance(law, Template) and any(gain.plant for gain in law.gains.values()):
        return not (plant.unmodelled or plant.free)
    if plant.pose and not law.joint:
        return law.name == "none"
    if not law.plants or plant.name in law.plants or (plant.pose and FREE_BODY in law.plants):
        return True
    plants = []
    for name in law.plants:
        if name in plants_known():
            plants.append(plants_known()[name])
    return (
        plant.is_user_model
        and plant.underactuated
        and any(machine.underactuated for machine in plants)
    )


KINDS = {  # of laws and of their parts -> the catalogue
    "law": law_catalogue,
    "joint": joint_law_catalogue,
    "surface": surface.surface_catalogue,
    "estimator": estimator.estimator_catalogue,
}


def laws(plant: Plant | str | None = None, kind: str = "law") -> list[str]:
    """List the names of laws; with a plant, only those for it: of one channel, or for a free body
    of many joints.

        smc.laws("cart_pole")

    A law that names no plants is for every plant whose channels all have an actuator. `none` is for
    every plant. A law for joints without an actuator is also for your own models with such joints.

    Args:
      plant: of the library by its name, or your own; None lists all.
      kind: "law", of one channel; "joint", a law of many joints; "surface"; or "estimator", of
        velocities.

    Returns:
      Names, in alphabetical order, which `smc.law` takes. `print(smc.law(name).template.doc)` shows
      a law's equation and the units of its gains.

    Raises:
      ScenarioError: another kind, a plant with another kind than "law", or an unknown plant.
    """
    names = find("kind of law", kind, KINDS)()
    if plant is None:
        return list(names)
    if kind != "law":
        raise ScenarioError(f"laws of kind {kind!r} are not for single plants: leave plant out")
    plant = as_plant(plant)
    candidates = all_laws() if plant.pose else law_catalogue()
    fully_driven = not plant.free and plant.pose != "heading"
    suited = []
    for name, law in candidates.items():
        unread = law.joint and plant.unmodelled  # a law of many joints reads the model
        if suits(law, plant) and (law.plants or name == "none" or fully_driven) and not unread:
            suited.append(name)
    return suited
