"""Classes of uncertainty: all that an adversary may do to a scenario, as bounds that are fixed
before anything is run.

    within = smc.Uncertainty(disturbance=2.0, mass=(0.7, 1.3), delay=(0.0, 0.005))

A member of a class is one choice within all of its bounds. `Members` makes scenarios of members. A
member has

    shares      one number in [0, 1] for each constant that may differ: set, delay, mass, x0, ...
    force       |force_k| <= 1, a number for each control sample: the disturbance over its bound
    noise       |noise_jk| <= 1, numbers for each time that an error of position or velocity is held
"""

import dataclasses
import functools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import SimpleNamespace
from typing import Annotated

import numpy as np

from smc_mujoco.common import constraints
from smc_mujoco.common.aliases import Array, Pair
from smc_mujoco.common.constraints import Natural, Positive, constrain, suggesting
from smc_mujoco.common.data import frozen_data, keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.frozen import frozen
from smc_mujoco.mechanisms.custom.model_numbers import dotted, model_numbers, with_model_numbers
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.hardware.friction import Coulomb
from smc_mujoco.mechanisms.plant import EFFORT, Plant
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Noise, Relay, Signal, bounds_of
from smc_mujoco.simulation.time_series import Held, TimeSeries

KNOT_SPACING = 0.5  # s between the knots of a random disturbance, straight lines in between; chosen
MIN_KNOTS = 8  # of a random disturbance in a run; chosen
MAX_PIECE_SHARE = 0.4  # of a run: the longest piece of a force that a change reverses; chosen
# that a change of a force shifts a switch, if it has one, instead of reversing a piece; chosen
SHIFT_PROBABILITY = 0.5
MOVE_PROBABILITY = 0.5  # of each constant, in a change of constants; chosen
CONSTANT_DEVIATION = 0.3  # standard deviation by which a constant moves, of its range; chosen
JITTER_SHARES = 8  # jitter is a multiple of this part of the control period; chosen
MULTIPLE_TOLERANCE = 1e-6  # of a step: a bound so close to a multiple is one
ROUNDING = 1e-12  # of the largest force: a smaller change of slope is none
# of the force of the weakest drive: the disturbance of the default class; chosen
DEFAULT_FORCE_SHARE = 1 / 6
DEFAULT_FRICTION_SCALE = (0.5, 1.5)  # of the default class; chosen

Range = Annotated[tuple[float, float], constraints.Range(low=0.0)]


@suggesting
@keyword_dataclass
class Uncertainty:
    """What may happen: bounds on disturbance, noise, delay and parameters.

    Everything left out is as in the scenario.

    Attributes:
      disturbance: |d| <= this, N or N m, the same force on every driven joint, beside the
        scenario's own disturbances.
      slope: |d'| <= this, N/s or N m/s; None: d may jump.
      position_noise, velocity_noise: bounds on errors of measurement, rad or m, and per second,
        beside the scenario's own noise. The adversary chooses the errors, the same in every
        channel.
      hold: time for which each error of measurement lasts, s.
      delay: lowest and highest input delay, s, beside the scenario's own; those tried are multiples
        of its physics step.
      jitter: largest delay of a sample, s, see `smc.Clock`; those tried are eighths of the control
        period. The scenario's seed decides which samples are late.
      mass: lowest and highest factor on the plant's mass.
      parameters: name -> lowest and highest factor on other parameters of the plant, or what is
        added to one of `plant.added`: {"payload": (0.0, 2.0)}. Your own model has those of a
        mismatch: {"elbow.damping": (0.5, 2.0), "hand.payload": (0.0, 2.0)}.
      friction: lowest and highest dry friction of the driven joints, N or N m, beside the
        scenario's own; `friction_scale` leaves it out.
      friction_scale: lowest and highest factor on the friction of the scenario and on the dry
        friction of its plant.
      encoder: lowest and highest counts of a position encoder, see `smc.Encoder`; equal ratios are
        equally likely.
      bound: lowest and highest factor on u_max.
      period: lowest and highest factor on the control period; those tried are multiples of the
        physics step.
      x0: how far each channel may start from the scenario's x0, as a share of it.

    Raises:
      ScenarioError: a bound that is no number, or out of order.
    """

    disturbance: Natural = 0.0
    slope: Positive | None = None
    position_noise: Natural = 0.0
    velocity_noise: Natural = 0.0
    hold: Positive = 0.05
    delay: Range = (0.0, 0.0)
    jitter: Natural = 0.0
    mass: Annotated[Pair, constraints.Range(above=0.0)] = (1.0, 1.0)
    parameters: Mapping[str, Pair] = frozen({})
    friction: Range = (0.0, 0.0)
    friction_scale: Range = (1.0, 1.0)
    encoder: Annotated[Pair, constraints.Range(low=2.0)] | None = None
    bound: Annotated[Pair, constraints.Range(above=0.0)] = (1.0, 1.0)
    period: Annotated[Pair, constraints.Range(above=0.0)] = (1.0, 1.0)
    x0: Natural = 0.0

    def __post_init__(self):
        constrain(self)
        if not isinstance(self.parameters, Mapping):
            raise ScenarioError(
                f"Uncertainty's parameters are {shown(self.parameters)}: give a range for each name"
            )
        parse_range = constraints.Range()
        ranges = {}
        for name, value in self.parameters.items():
            ranges[str(name)] = parse_range(f"Uncertainty's {name}", value)
        vars(self)["parameters"] = frozen(ranges)  # the class is frozen
        bounds = (
            self.disturbance,
            self.position_noise,
            self.velocity_noise,
            self.jitter,
            self.x0,
            self.encoder,
        )
        ends = self.delay, self.mass, self.friction, self.friction_scale, self.bound, self.period
        ranged = [*ends, *ranges.values()]
        if not any(bounds) and all(low == high for low, high in ranged):
            raise ScenarioError(
                "Uncertainty allows nothing but the scenario itself: give a bound, such as "
                "disturbance=2.0"
            )

    def words(self, plant: Plant) -> str:
        """Return the bounds that were given as text, such as "disturbance 2 N, mass 0.7 to 1.3"."""
        bounds = {}
        for field in dataclasses.fields(self):
            if getattr(self, field.name) != field.default:
                bounds[field.name] = getattr(self, field.name)
        bounds |= bounds.pop("parameters", {})
        return words_of(bounds, plant)


def words_of(given: Mapping[str, float | Pair], plant: Plant) -> str:
    """Return numbers or bounds by name as text, such as "disturbance 2 N, mass 0.7 to 1.3"."""
    x = plant.units[0]
    force = EFFORT[x]
    units = {"disturbance": force, "slope": f"{force}/s", "friction": force}
    units |= {"position_noise": x, "velocity_noise": f"{x}/s", "encoder": "counts"}
    units |= dict.fromkeys(("hold", "delay", "jitter"), "s")
    parts = []
    for name, bound in given.items():
        ends = bound if isinstance(bound, tuple) else (bound,)
        width = " to ".join(f"{end:.4g}" for end in ends)
        words = f"{name.replace('_', ' ')} {width} {units.get(name, '')}"
        parts.append(words.strip())
    return ", ".join(parts)


def default_class(scenario: Scenario) -> Uncertainty:
    """Return the default class of a scenario: what its plant declares as `uncertain`, and friction
    within 50 %.

    If the plant declares nothing: a disturbance up to a sixth of the force of the weakest drive.
    """
    declared = scenario.plant.uncertain
    bounds = {}
    if not declared:
        bounds["disturbance"] = DEFAULT_FORCE_SHARE * strength(scenario)
    if scenario.friction or dry_frictions(scenario.plant):
        bounds["friction_scale"] = DEFAULT_FRICTION_SCALE
    return Uncertainty(parameters=declared, **bounds)


def strength(scenario: Scenario) -> float:
    """Return the largest force that every drive can hold, N or N m."""
    return min(scenario.drive_train.forces)


def outside(scenario: Scenario, within: Uncertainty) -> str:
    """Return how a class around a scenario goes beyond the theorem of its law, in words; "" if
    nothing is known.
    """
    disturbance = within.disturbance
    slope = 0.0
    if disturbance:
        slope = within.slope or math.inf
    for signal in scenario.disturbance:
        if bounds := bounds_of(signal):
            disturbance += bounds[0]
            slope += bounds[1]
    reasons = []
    if disturbance >= strength(scenario):
        reasons.append("the disturbance exceeds what the drives hold")
    if scenario.law.template is None or not scenario.law.template.admits:
        return "; ".join(reasons)
    admits = scenario.law.template.admits
    gains = SimpleNamespace(**next(iter(scenario.law.of_channels(scenario.plant.driven))).gains)
    of_disturbance = ("d", disturbance, "disturbance"), ("d'", slope, "disturbance's rate")
    for name, value, words in of_disturbance:
        if disturbance and name in admits and value >= admits[name](gains):
            reasons.append(f"the {words} exceeds the bound of the law's theorem")
    beside = (
        within.delay[1] or scenario.input_delay,
        within.position_noise or within.velocity_noise or scenario.noise != Noise(),
        scenario.sensor,
        scenario.actuator,
        within.jitter or not scenario.clock.regular,
    )
    if any(beside):
        reasons.append("the law's theorem has no delay, noise, sensor, drives or late samples")
    return "; ".join(reasons)


@dataclasses.dataclass(frozen=True, eq=False)
class Member:
    """One choice within the bounds of a class, see the module."""

    shares: Array  # (constants,)
    force: Array  # (samples + 1,), or (0,) without a disturbance
    noise: Array  # (2, times); times is 0 without noise
    kind: str = ""  # the strategy that made it

    def of_kind(self, kind: str) -> "Member":
        """Return this member as one of another strategy."""
        return dataclasses.replace(self, kind=kind)


class Members:
    """The members of a class around one scenario, or around the same scenario on several parameter
    sets.

    `constants` has a `RunConstant` for each share of a member. If there are several parameter sets,
    the first chooses one. `ends` are the shares at corners. `bare` has no force or noise, and
    shares of 0.5, on the first parameter set.
    """

    def __init__(self, scenarios: Sequence[Scenario], within: Uncertainty):
        if dotted(within.parameters):
            scenarios = [_with_numbers(case, within) for case in scenarios]
        scenario = scenarios[0]
        count = len(scenarios)
        self.scenario = scenario
        self.within = within
        self.h = scenario.control_period
        self.samples = scenario.samples
        self.forced = within.disturbance > 0.0
        # N or N m a sample; 0: d may jump
        self.slope = (within.slope or 0.0) * self.h
        _check_class(scenario, within)
        self.constants = list(_constants(scenario, within))
        if count > 1:
            sets = RunConstant(
                "set", (0.0, count), lambda _, at: scenarios[min(int(at), count - 1)]
            )
            self.constants.insert(0, sets)
        self.ends = [[0.0, 1.0] for _ in self.constants]
        # samples that an error of measurement lasts
        self.hold = max(1, round(within.hold / self.h))
        self.times = 0
        if within.position_noise or within.velocity_noise:
            self.times = -(-self.samples // self.hold)
        if self.times and any(scenario.noise.errors):
            raise ScenarioError(
                f"the scenario has errors of measurement, {scenario.noise.errors}, and the "
                "adversary chooses them: leave them out"
            )
        middle = np.full(len(self.constants), 0.5)
        if count > 1:
            self.ends[0] = [(i + 0.5) / count for i in range(count)]
            middle[0] = 0.0
        no_noise = np.zeros((2, self.times))
        self.bare = Member(middle, np.zeros(0), no_noise)
        for constant in self.constants:
            constant.check(scenario)
        for share in (0.0, 1.0):
            # raises where bounds do not go together
            self.with_constants(np.full(len(self.constants), share))

    def with_constants(self, shares: Array) -> Scenario:
        """Return the scenario with constants of the class."""
        scenario = self.scenario
        for constant, share in zip(self.constants, shares.tolist(), strict=True):
            scenario = constant.put(scenario, constant.value(share))
        return scenario

    def scenario_of(self, member: Member, relay: Relay | None = None) -> Scenario:
        """Return the scenario of a member.

        From its start on, a relay takes the place of the member's force.
        """
        scenario = self.with_constants(member.shares)
        force = self.within.disturbance * member.force
        if relay:
            started = np.arange(len(force)) * self.h >= relay.start
            force = np.where(started, 0.0, force)
        signals = [*scenario.disturbance]
        if force.any():
            signals.append(self.signal(force))
        if relay:
            signals.append(relay)
        scenario = dataclasses.replace(scenario, disturbance=tuple(signals))
        if not self.times:
            return scenario
        bounds = {
            "position_error": self.within.position_noise,
            "velocity_error": self.within.velocity_noise,
        }
        t = (np.arange(self.times + 1) * self.hold * self.h).tolist()
        rows = zip(bounds.items(), member.noise, strict=True)
        errors = {}
        for (name, bound), row in rows:
            if bound:
                errors[name] = Held(t, [*(bound * row).tolist(), 0.0])
        return dataclasses.replace(scenario, noise=dataclasses.replace(scenario.noise, **errors))

    def signal(self, values: Array) -> Signal:
        """Return values at the samples as a signal: steps if it may jump and does so rarely, else
        straight lines.
        """
        change = np.diff(values)
        steps = not self.slope and 2 * np.count_nonzero(change) < len(change)
        if steps:
            bends = change != 0.0
        else:
            bends = np.abs(np.diff(change)) > ROUNDING * np.abs(values).max()
        inner = np.flatnonzero(bends) + 1
        places = np.unique(np.concatenate([[0], inner, [len(values) - 1]]))
        times = (places * self.h).tolist()
        if steps:
            return Held(times, values[places].tolist())
        return TimeSeries(times, values[places].tolist())

    def limited(self, force: Array) -> Array:
        """Return a force limited to -1 .. 1, and in its slope."""
        force = np.clip(force, -1.0, 1.0)
        change = self.slope / self.within.disturbance
        if not change or np.abs(np.diff(force)).max(initial=0.0) <= change:
            return force
        before, *later = force.tolist()
        limited = [before]
        for value in later:
            before = min(max(value, before - change), before + change)
            limited.append(before)
        return np.array(limited)

    def random(self, rng: np.random.Generator) -> Member:
        """Return a member drawn at random: uniform constants, knots and errors."""
        knot = min(KNOT_SPACING, self.samples * self.h / MIN_KNOTS)
        knots = np.arange(math.ceil(self.samples * self.h / knot) + 1) * knot
        times = np.arange(self.samples + 1) * self.h
        values = np.interp(times, knots, rng.uniform(-1.0, 1.0, len(knots)))
        return Member(
            rng.uniform(size=len(self.constants)),
            self.limited(values) if self.forced else np.zeros(0),
            rng.uniform(-1.0, 1.0, (2, self.times)),
            "random",
        )

    def changed(self, member: Member, rng: np.random.Generator) -> Member:
        """Return a member that differs from one in its force, its noise or its constants."""
        weights = np.array(
            [3.0 * self.forced, 2.0 * (self.times > 0), len(self.constants) > 0], float
        )
        what = rng.choice(3, p=weights / weights.sum())
        if what == 0:
            return dataclasses.replace(
                member, force=self.limited(mutated_signal(member.force, rng))
            )
        if what == 1:
            noise = [mutated_signal(row, rng) for row in member.noise]
            return dataclasses.replace(member, noise=np.array(noise))
        moves = rng.normal(0.0, CONSTANT_DEVIATION, len(self.constants))
        moves = moves * (rng.random(len(self.constants)) < MOVE_PROBABILITY)
        return dataclasses.replace(member, shares=np.clip(member.shares + moves, 0.0, 1.0))

    def size(self, knots: int) -> int:
        """Return how many numbers `moved` takes as z."""
        return len(self.constants) + knots * (self.forced + 2 * (self.times > 0))

    def moved(self, member: Member, z: Array, knots: int) -> Member:
        """Return a member moved by z, (size,): its constants, then knots of lines that are added to
        its signals.
        """
        m = len(self.constants)
        rows = np.reshape(z[m : self.size(knots)], (-1, knots))
        shares = np.clip(member.shares + CONSTANT_DEVIATION * z[:m], 0.0, 1.0)
        knot_places = np.linspace(0.0, 1.0, knots)

        def added(row: Array, more: Array) -> Array:
            along = np.linspace(0.0, 1.0, len(row))
            return np.clip(row + 2.0 * np.interp(along, knot_places, more), -1.0, 1.0)

        force = self.limited(added(member.force, rows[0])) if self.forced else member.force
        if self.times:
            noise = []
            for pair in zip(member.noise, rows[-2:], strict=True):
                noise.append(added(*pair))
        else:
            noise = member.noise
        return Member(shares, force, np.array(noise), member.kind)


def mutated_signal(values: Array, rng: np.random.Generator) -> Array:
    """Return values, (K,), of which a random piece is reversed in sign, or a switch comes earlier
    or later.
    """
    mutated = values.copy()
    last = len(values) - 1
    longest = max(2.0, MAX_PIECE_SHARE * last)
    length = round(math.exp(rng.uniform(0.0, math.log(longest))))
    signs = np.sign(values)
    switches = np.flatnonzero(signs[1:] != signs[:-1]) + 1
    if len(switches) and rng.random() < SHIFT_PROBABILITY:
        begin = int(rng.choice(switches))
        piece = slice(begin, begin + length)
        if rng.random() < 0.5:
            piece = slice(max(0, begin - length), begin)
    else:
        begin = int(rng.integers(1 - length, max(last, 2 - length)))
        piece = slice(max(0, begin), begin + length)
    mutated[piece] *= -1.0
    return mutated


@frozen_data
class RunConstant:
    """Something that is constant in a run and may differ from member to member."""

    name: str
    bounds: Pair
    put: Callable[[Scenario, float], Scenario]  # the scenario with a value
    # of a value; "" for a factor, "added" for what is added to a parameter, "%" for a relative
    # change
    unit: str = ""
    geometric: bool = False  # whether equal ratios, rather than equal differences, are equal shares

    def value(self, share: float) -> float:
        """Return the value at a share in [0, 1] of the range."""
        low, high = self.bounds
        if self.geometric:
            return low * (high / low) ** share
        return min(low + share * (high - low), high)

    def check(self, scenario: Scenario) -> None:
        """Raise ScenarioError, which names the bound, if the scenario cannot have it at an end of
        its range.
        """
        for value in self.bounds:
            try:
                self.put(scenario, value)
            except ScenarioError as error:
                named = self.name.partition(" ")[0]
                raise ScenarioError(f"Uncertainty's {named} of {value:g}: {error}") from None


def _with_numbers(scenario: Scenario, within: Uncertainty) -> Scenario:
    """Return the scenario with the numbers of joints and bodies that may differ among the
    parameters of its plant.
    """
    plant = with_model_numbers(scenario.plant, dotted(within.parameters))
    return dataclasses.replace(scenario, plant=plant)


def _check_class(scenario: Scenario, within: Uncertainty) -> None:
    """Raise ScenarioError for a parameter that the plant does not have, or for a delay beyond the
    end of a run.
    """
    plant = scenario.plant
    foreign = []
    for name in within.parameters:
        if name not in plant.parameters and name != "mass":
            foreign.append(name)
    if foreign:
        fields = []
        for field in dataclasses.fields(within):
            if field.name != "parameters":
                fields.append(field.name)
        names = ", ".join(sorted({*fields, *plant.parameters}))
        raise ScenarioError(
            f"no bound and no parameter of {plant.name} is called {foreign[0]!r}: choose from "
            f"{names}"
        )
    if (longest := scenario.duration - scenario.input_delay) < within.delay[1]:
        raise ScenarioError(
            f"Uncertainty's delay reaches {within.delay[1]:g} s: give at most {longest:g}, a "
            "run's end"
        )


def _constants(scenario: Scenario, within: Uncertainty) -> Iterator[RunConstant]:
    """Yield each constant that may differ."""
    effort = EFFORT[scenario.plant.units[0]]
    plant = scenario.plant
    if within.delay != (0.0, 0.0):
        bounds = _multiples("delay", within.delay, scenario.resolved.physics_step)
        yield RunConstant("delay", bounds, _with_delay, "s")
    if within.jitter:
        step = scenario.control_period / JITTER_SHARES
        _, jitter = _multiples("jitter", (0.0, within.jitter), step)
        yield RunConstant("jitter", (0.0, jitter / scenario.control_period), with_jitter, "periods")
    for name, bounds in {"mass": within.mass, **within.parameters}.items():
        if bounds != (1.0, 1.0):
            unit = "added" if name in plant.added else ""
            yield RunConstant(name, bounds, functools.partial(_with_factor, name=name), unit)
    if within.friction_scale != (1.0, 1.0):
        if not (scenario.friction or dry_frictions(plant)):
            raise ScenarioError(
                f"Uncertainty's friction_scale is of {plant.name}, which has no friction here: "
                "give it some, such as friction=smc.Coulomb(0.1)"
            )
        yield RunConstant("friction_scale", within.friction_scale, _with_friction_scale)
    if within.friction != (0.0, 0.0):
        yield RunConstant("friction", within.friction, with_friction, effort)
    if within.encoder:
        yield RunConstant("encoder", within.encoder, _with_counts, "counts", geometric=True)
    if within.bound != (1.0, 1.0):
        if not math.isfinite(min(scenario.limits)):
            raise ScenarioError("Uncertainty's bound needs a finite one: give the scenario a u_max")
        yield RunConstant("bound", within.bound, _with_bound)
    for i in range(plant.n if within.x0 else 0):
        name = f"x0 {i + 1}" if plant.n > 1 else "x0"
        yield RunConstant(name, (-within.x0, within.x0), functools.partial(_with_start, i=i), "%")
    if within.period != (1.0, 1.0):
        bounds = _multiples("period", within.period, 1.0 / scenario.steps)
        yield RunConstant("period", bounds, _with_period)


def _multiples(name: str, bounds: Pair, step: float) -> Pair:
    """Return the lowest and the highest multiple of a step within bounds; refuse a range with one,
    or only 0.
    """
    low = math.ceil(bounds[0] / step - MULTIPLE_TOLERANCE) * step
    high = math.floor(bounds[1] / step + MULTIPLE_TOLERANCE) * step
    if high < max(low, step) or (low == high and bounds[0] < bounds[1]):
        raise ScenarioError(
            f"Uncertainty's {name} is from {bounds[0]:g} to {bounds[1]:g}, and a run has multiples "
            f"of {step:g}: give a range with several of these"
        )
    return low, high


def _with_delay(scenario: Scenario, delay: float) -> Scenario:
    """Return the scenario with an input delay longer by a number of physics steps."""
    step = scenario.resolved.physics_step
    return dataclasses.replace(
        scenario, input_delay=(scenario.delay_steps + round(delay / step)) * step
    )


def _with_factor(scenario: Scenario, value: float, name: str) -> Scenario:
    """Return the scenario with a factor on a parameter of the plant, or a term for a parameter of
    `plant.added`.
    """
    plant = scenario.plant
    mismatch = dict(scenario.mismatch)
    if name == "mass" and plant.mass in mismatch:
        name = plant.mass
    if name in plant.added:
        mismatch[name] = mismatch.get(name, 0.0) + value
    else:
        mismatch[name] = mismatch.get(name, 1.0) * value
    return dataclasses.replace(scenario, mismatch=mismatch)


def _with_counts(scenario: Scenario, counts: float) -> Scenario:
    """Return the scenario with encoders of so many counts; all else of its sensors stays."""
    sensors = []
    for sensor in scenario.sensors or (Encoder(),):
        sensors.append(dataclasses.replace(sensor, counts=round(counts)))
    return dataclasses.replace(scenario, sensor=sensors)


def _with_bound(scenario: Scenario, factor: float) -> Scenario:
    """Return the scenario with a factor on u_max."""
    u_max = scenario.resolved.u_max
    if isinstance(u_max, tuple):
        scaled = tuple(factor * bound for bound in u_max)
    else:
        scaled = factor * u_max
    return dataclasses.replace(scenario, u_max=scaled)


def _with_period(scenario: Scenario, factor: float) -> Scenario:
    """Return the scenario with a factor on the control period, to the next multiple of the same
    physics step.
    """
    step = scenario.resolved.physics_step
    period = max(1, round(factor * scenario.control_period / step)) * step
    return dataclasses.replace(scenario, control_period=period, physics_step=step)


def _with_start(scenario: Scenario, share: float, i: int) -> Scenario:
    x0 = list(scenario.resolved.x0)
    x0[i] *= 1.0 + share
    return dataclasses.replace(scenario, x0=x0)


def with_friction(scenario: Scenario, level: float) -> Scenario:
    """Return the scenario with `level` added to the dry friction of driven joints, N or N m."""
    before = 0
    further = []
    for part in scenario.friction:
        if isinstance(part, Coulomb) and not part.on:
            before += part.level
        else:
            further.append(part)
    return dataclasses.replace(scenario, friction=(*further, Coulomb(before + level)))


def dry_frictions(plant: Plant) -> list[str]:
    """Return the names of the dry frictions of a plant, or of the joints of a user's model, that
    are not 0.
    """
    names = [name for name in plant.dry if plant.parameters[name]]
    for name, constant in model_numbers(plant).items():
        if constant.kind == "frictionloss" and constant.value:
            names.append(name)
    return names


def _with_friction_scale(scenario: Scenario, factor: float) -> Scenario:
    """Return the scenario with a factor on its friction, and on the dry friction of its plant."""
    friction = [part.scaled(factor) for part in scenario.friction]
    scenario = dataclasses.replace(scenario, friction=tuple(friction))
    for name in dry_frictions(scenario.plant):
        scenario = _with_factor(scenario, factor, name)
    return scenario


def with_jitter(scenario: Scenario, level: float) -> Scenario:
    """Return the scenario whose samples are late by up to `level` control periods, counted in
    eighths of one.
    """
    steps = math.lcm(JITTER_SHARES, scenario.steps)  # so that delays stay multiples of a step
    jitter = round(level * JITTER_SHARES) / JITTER_SHARES * scenario.control_period
    clock = dataclasses.replace(scenario.clock, jitter=jitter)
    return dataclasses.replace(scenario, clock=clock, physics_step=scenario.control_period / steps)
