"""What to record, so that numbers of a machine can be told apart: candidate motions, best first.

    motions = smc.design.excitation(arm, ["shoulder.damping", "shoulder.frictionloss"], u_max=5.0)
    print(motions)
    motions.save("motion.csv")

Each motion is as large as range, speed and force allow, and is run on the model with typical
numbers: a force by a PD law that knows them, a position servo by its set-point. The log of the run
gives the errors that identification would tell of it: those of the encoder's noise, of the replays'
steps, and of dry friction that may give way before it slides. What another wrong model adds is not
in them. Source of the idea: J. Swevers, C. Ganseman, D. B. Tukel, J.
De Schutter and H. Van Brussel, Optimal robot excitation and identification, IEEE Transactions on
Robotics and Automation 13(5), 1997; here the motions are given, and only their sizes are found.
"""

import copy
import csv
import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import mujoco
import numpy as np

from smc_mujoco.common.aliases import AnyPath, Array, Fields, Floats, Names, Numbers
from smc_mujoco.common.constraints import Natural, Positive, Whole, constrained
from smc_mujoco.common.data import attributes, keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, find, items_of, number, shown
from smc_mujoco.common.files import as_path, replacing
from smc_mujoco.control.from_text import law as find_law
from smc_mujoco.control.law import Law
from smc_mujoco.identification import gauss_newton, inverse_dynamics
from smc_mujoco.identification.lack_of_fit import lack_of_fit
from smc_mujoco.identification.log_rig import LONG_STEP, LogPart
from smc_mujoco.identification.own_rig import OwnRig, own_rig
from smc_mujoco.identification.paths import DELAY, named_once
from smc_mujoco.identification.presliding import presliding
from smc_mujoco.identification.replays import Point, Replays, Slopes
from smc_mujoco.identification.rig import Values
from smc_mujoco.identification.standard_errors import check_told_apart, statistics
from smc_mujoco.mechanisms.hardware.encoder import Encoder
from smc_mujoco.mechanisms.hardware.position_servo import PositionServo
from smc_mujoco.mechanisms.layout import (
    channel_names,
    column_ends,
    dof_ids,
    driven_names,
    joint_ids,
)
from smc_mujoco.mechanisms.named import jointed
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.readings import as_recorded
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Noise
from smc_mujoco.simulation.time_series import TimeSeries
from smc_mujoco.simulation.trace import Trace

# Hz and damping ratio of the PD law; chosen
BANDWIDTH, DAMPING_RATIO = 4.0, 0.7
SOFT_START = 0.5  # s
BISECTIONS = 10  # of the size of a motion
AMPLITUDE = {"rad": 0.5, "m": 0.1}  # of a joint, where its range allows it; chosen
OF_RANGE = 0.9  # of the way to a limit of the joint's range; chosen
OF_FORCE = 0.7  # of the bound on u, that the motion itself may take; chosen
# s, longest physics step of the runs; chosen: with 0.25 ms dry friction creeps so much that logs of
# them show it by 7.6 deviations
PLAYED_STEP = 1e-4
INTEGRATOR = "implicitfast"  # of friction that gives way: errors need no more; chosen
# Typical numbers where the model has 0: of the bound on u, of a joint's inertia, s; chosen
FRICTION_SHARE, ARMATURE_SHARE, TYPICAL_DELAY = 0.03, 0.2, 0.004
Counts = Annotated[float, Whole(low=2, high=2**32, infinite=True)]
CHANCE = 4.0  # by which the noise of a log alone moved the errors that it told
SLOW = 0.02  # of the largest speed of a joint: below it the joint counts as at rest; chosen
FORCE_STRIDE = 10  # samples between those whose forces are computed; chosen
HOLD, RAMP = 0.6, 0.15  # s, of a stair


@keyword_dataclass
class ExcitingMotion:
    """A motion, and what its log would tell.

    Attributes:
      name: what it is.
      times: s, (K,).
      positions: of each driven joint, rad or m, (driven, K).
      condition: number of the scaled slopes of the log.
      errors: quantity -> expected standard error, in its unit.
      values: quantity -> the number that it has in the simulation.
      largest_u, largest_v: of all joints, N m or N, and rad/s or m/s.
      worst_pair: the two quantities that are told apart worst, and the correlation of their errors.
      rest: share of the time at which every joint is below 2 % of its largest speed.
    """

    name: str
    times: Floats
    positions: tuple[Floats, ...]
    condition: float
    errors: Numbers
    values: Numbers
    largest_u: float
    largest_v: float
    worst_pair: tuple[str, str, float]
    rest: float

    @property
    def reference(self) -> tuple[TimeSeries, ...]:
        """The signal of each driven joint."""
        return tuple(TimeSeries(self.times, row) for row in self.positions)

    def share(self, name: str) -> float:
        """Return the expected error of a quantity over its value."""
        return self.errors[name] / max(abs(self.values[name]), 1e-300)

    @property
    def mean_share(self) -> float:
        """The geometric mean of the expected errors over their values."""
        logarithms = [math.log(self.share(name)) for name in self.errors]
        return math.exp(sum(logarithms) / len(logarithms))


@keyword_dataclass
class Excitation:
    """Candidate motions, best first: that whose relative errors have the least geometric mean."""

    motions: tuple[ExcitingMotion, ...]
    plant: Plant
    assumed: str  # what the errors are expected of: a sentence

    @property
    def columns(self) -> Names:
        """The columns of a file: references of the driven joints."""
        return tuple(f"r{end}" for end in column_ends(self.plant)[: self.plant.driven])

    def __str__(self) -> str:
        """Return a line for each motion, why the last is last, what an order is worth, and what was
        assumed.
        """
        driven = self.plant.driven
        # the largest value is that of any joint: a machine with hinges and slides has two units
        effort = " or ".join(dict.fromkeys(self.plant.efforts[:driven]))
        speed = " or ".join(f"{unit}/s" for unit in dict.fromkeys(self.plant.units[:driven]))
        lines = []
        for motion in self.motions:
            errors = []
            for name in motion.errors:
                errors.append(f"{name} {100.0 * motion.share(name):.2g} %")
            lines.append(
                f"{motion.name}: condition number {motion.condition:.3g}; expected errors "
                f"{', '.join(errors)}; |u| up to {motion.largest_u:.3g} {effort}, |v| up to "
                f"{motion.largest_v:.3g} {speed}"
            )
        best, last = self.motions[0], self.motions[-1]
        first, second, correlation = last.worst_pair
        why = (
            f"{last.name} is last: its errors are {last.mean_share / best.mean_share:.2g} times "
            f"those of the best, and it rests for {100.0 * last.rest:.0f} % of the time"
        )
        if second:
            why += f"; {first} and {second} are told apart worst (correlation {correlation:.2f})"
        doubt = f"an order by less than a factor of {CHANCE:g} may be chance"
        return "\n".join([*lines, f"{why}; {doubt}", self.assumed])

    def about(self) -> Fields:
        """Return what a log of each motion would tell as JSON data, best first."""
        fields = ("condition", "errors", "values", "largest_u", "largest_v", "worst_pair", "rest")
        return {motion.name: attributes(motion, fields) for motion in self.motions}

    def figure(self, path: AnyPath) -> list[Path]:
        """Draw the references of the motions beside their expected errors, as PATH.svg and
        PATH.png.
        """
        from smc_mujoco.identification.excitation_figure import excitation_figure

        joints = driven_names(self.plant)
        return excitation_figure(self.motions, joints, self.plant.units[: len(joints)], path)

    def save(self, path: AnyPath, name: str | None = None) -> Path:
        """Write the reference of a motion as CSV, the best by default: t, and r or r_JOINT, rad or
        m. Return the path.
        """
        motions = {motion.name: motion for motion in self.motions}
        motion = self.motions[0] if name is None else find("motion", name, motions)
        with replacing(as_path(path)) as part, part.open("w", newline="", encoding="utf-8") as file:
            rows = csv.writer(file)
            rows.writerow(["t", *self.columns])
            rows.writerows(zip(motion.times, *motion.positions, strict=True))
        return as_path(path)


@constrained
def excitation(
    machine: Plant | Scenario | str,
    names: Sequence[str],
    *,
    u_max: Positive | None = None,
    v_max: Positive | None = None,
    amplitude: float | Sequence[float] | None = None,
    guess: Mapping[str, float] | None = None,
    duration: Positive = 8.0,
    rate: Positive = 500.0,
    noise: Natural = 2e-4,
    counts: Counts = 4096,
) -> Excitation:
    """Recommend a motion to record, from which a machine's parameters can be told apart.

        arm = "arm.xml:elbow+held"
        print(smc.design.excitation(arm, ["elbow.damping"], u_max=5.0, duration=2.0))

    Args:
      machine, names: as of `smc.identify`.
      u_max: bound on |u| of each motor, N m or N; default: the model's.
      v_max: bound on the speed of the motion that is asked of each joint, rad/s or m/s; the joint
        may go some per cent beyond, see |v| in the answer. Default: none.
      amplitude: largest way from the goal to each side, rad or m: one for all driven joints, or one
        for each. Default: 0.5 rad, 0.1 m, or 0.9 of the way to a limit of the joint's range.
      guess: quantity -> about its value. Where the model has 0, the default is typical: friction
        3 % of u_max, armature a fifth of the inertia, a delay of 4 ms.
      duration: s, of each motion.
      rate: Hz, of the log.
      noise: standard deviation of the positions in the log, rad or m, before they are rounded.
      counts: of the encoders, per revolution of a hinge or per metre of a slide; math.inf for none.
        The sensor of a scenario counts instead.

    Returns:
      The motions, best first, with condition numbers, expected errors and the worst pair. `save`
      writes the CSV to play, and `figure` draws them. It prints what was assumed: give your own
      noise, counts, rate and guess, because the errors follow them. On ten drawn machines
      `identify` told .55 to 2.1 times the expected errors of a chirp in a stable loop; on one more,
      of other motions, .29 to 4.8 times. The noise of a log alone moved told errors by up to 4.4
      times, so an order by less than a factor of 4 may be chance.

    Raises:
      ScenarioError: as `smc.identify` of paths; no motion that the machine can follow.
    """
    base = machine if isinstance(machine, Scenario) else jointed(machine, "excitation")
    names = named_once(names)
    rig = own_rig(base, names)
    rig.check_named(["smc-mujoco", "excitation", machine] if isinstance(machine, str) else [])
    drives = rig.drives(u_max)
    forces = largest_forces(drives)
    rig = rig.with_values(typical(rig, forces) | dict(guess or {}), "typical")
    shapes = candidate_shapes(rig.plant.driven, duration, rate)
    moved = _sized(rig, shapes, _ways(drives, amplitude), 1.0 / rate, forces, v_max)
    sensor = rig.base.sensor or Encoder(counts=counts)
    motions = _motions(rig, names, moved, 1.0 / rate, drives, (noise, sensor))
    return Excitation(
        motions=tuple(sorted(motions, key=lambda motion: motion.mean_share)),
        plant=rig.plant,
        assumed=_assumed(rig, names, rate, noise, sensor),
    )


def _assumed(rig: OwnRig, names: Sequence[str], rate: float, noise: float, sensor: Any) -> str:
    """Return a sentence on what the errors are expected of."""
    values = []
    for name in names:
        values.append(f"{name} {rig.values[name]:.3g}")
    rounding = "the scenario's sensor"
    if not rig.base.sensor:
        rounding = f"encoders of {sensor.counts:g} counts"
    return (
        f"assumed: {', '.join(values)}; a log of {rate:g} samples a second, noise of {noise:.2g} "
        f"rad (m), {rounding}"
    )


def largest_forces(drives: Scenario) -> Array:
    """Return the largest force of each drive at rest, N m or N, (driven,)."""
    forces = []
    for motor, bound in zip(drives.drive_train.motors, drives.limits, strict=True):
        forces.append(motor.force_at(bound))
    return np.array(forces)


def _ways(drives: Scenario, amplitude: float | Sequence[float] | None) -> Array:
    """Return the largest way of each driven joint to each side of its goal, (driven,)."""
    plant = drives.plant
    if amplitude is not None:
        amplitudes: Any = [amplitude] if np.ndim(amplitude) == 0 else amplitude
        ways = []
        for way in items_of("amplitude", amplitudes):
            ways.append(number("amplitude", way, above=0.0))
        if len(ways) not in (1, plant.driven):
            raise ScenarioError(f"amplitude has {len(ways)} values: give one, or {plant.driven}")
        return np.broadcast_to(ways, (plant.driven,)).copy()
    ways = np.array([AMPLITUDE.get(unit, 0.5) for unit in plant.units[: plant.driven]])
    goal = plant.rest or (0.0,) * plant.n
    names = channel_names(plant)
    for joint, low, high in plant.ranges:
        if (i := names.index(joint)) < plant.driven:
            ways[i] = min(ways[i], OF_RANGE * min(goal[i] - low, high - goal[i]))
    for i, motor in enumerate(drives.drive_train.motors):
        if isinstance(motor, PositionServo):
            ways[i] = min(ways[i], OF_RANGE * (drives.limits[i] - abs(goal[i] - motor.goal)))
    return ways


def typical(rig: OwnRig, bounds: Array) -> dict[str, float]:
    """Return quantity -> a typical value, of those that the model has as 0."""
    model = rig.plant.load()
    inertia = dict(zip(channel_names(rig.plant), model.dof_M0[dof_ids(model)], strict=True))
    force = dict(zip(driven_names(rig.plant), bounds.tolist(), strict=True))
    values = {}
    for name, quantity in rig.quantities.items():
        joint, _, kind = name.rpartition(".")
        if quantity.value:
            continue
        if kind in ("damping", "frictionloss"):
            values[name] = FRICTION_SHARE * force.get(joint, min(force.values()))
        elif kind == "armature":
            values[name] = ARMATURE_SHARE * float(inertia.get(joint, 0.0))
        elif name == DELAY:
            values[name] = TYPICAL_DELAY
        elif kind == "offset":
            values[name] = FRICTION_SHARE * force[joint]
    return values


def candidate_shapes(joints: int, duration: float, rate: float) -> dict[str, Array]:
    """Return name -> a motion of each joint between -1 and 1, (joints, K): what people record."""
    t = np.arange(round(duration * rate) + 1) / rate
    rng = np.random.default_rng(1)

    def sines(frequencies: Sequence[float], shares: Sequence[float]) -> Array:
        rows = []
        for i in range(joints):
            y = np.zeros_like(t)
            for frequency, share in zip(frequencies, shares, strict=True):
                phase = rng.uniform(0.0, 2.0 * math.pi)
                y += share * np.sin(2.0 * math.pi * frequency * (1.0 + 0.07 * i) * t + phase)
            rows.append(y / np.abs(y).max())
        return np.array(rows)

    def chirp(low: float, high: float) -> Array:
        phase = 2.0 * math.pi * (low * t + 0.5 * (high - low) / duration * t * t)
        return np.array([np.sin(phase + 0.9 * i) for i in range(joints)])

    def stairs() -> Array:
        k = np.floor(t / HOLD).astype(int)
        levels = np.array([0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0, -0.5])
        s = np.clip((t - k * HOLD) / RAMP, 0.0, 1.0)
        before = levels[k % 8]
        after = levels[(k + 1) % 8]
        y = before + (after - before) * s * s * (3.0 - 2.0 * s)
        return np.array([y * (-1.0) ** i for i in range(joints)])

    shapes = {
        "slow sine of 0.2 Hz": sines([0.2], [1.0]),
        "one sine of 0.7 Hz": sines([0.7], [1.0]),
        "three sines of 0.4, 1.1 and 2.7 Hz": sines([0.4, 1.1, 2.7], [1.0, 0.6, 0.3]),
        "chirp from 0.2 to 3 Hz": chirp(0.2, 3.0),
        "staircase": stairs(),
    }
    share = np.minimum(1.0, t / SOFT_START)
    soft = share * share * (3.0 - 2.0 * share)  # a corner would take the largest force of all
    return {name: shape * soft for name, shape in shapes.items()}


def _sized(
    rig: OwnRig,
    shapes: Mapping[str, Array],
    ways: Array,
    step: float,
    bounds: Array,
    v_max: float | None,
) -> dict[str, Array]:
    """Return the motions about the goal, (driven, K), as large as ways, (driven,), and bounds
    allow.
    """
    plant = rig.plant
    goal = np.array(plant.rest or (0.0,) * plant.n)[: plant.driven]
    moved = {}
    for name, shape in shapes.items():
        size = largest_size(rig, goal, ways[:, None] * shape, step, bounds, v_max)
        moved[name] = goal[:, None] + size * ways[:, None] * shape
    return moved


def largest_size(
    rig: OwnRig, goal: Array, shape: Array, step: float, bounds: Array, v_max: float | None
) -> float:
    """Return the factor up to 1 on a motion (driven, K) about the goal, with which speeds and the
    forces that it takes stay within their bounds.
    """

    def fits(size: float) -> bool:
        speeds = np.gradient(size * shape, step, axis=1)
        forces = motion_forces(rig, goal[:, None] + size * shape, step)
        largest = np.abs(forces).max(axis=1)
        slow = v_max is None or float(np.abs(speeds).max()) <= v_max
        return slow and bool(np.all(largest <= OF_FORCE * bounds))

    if fits(1.0):
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        size = 0.5 * (low + high)
        low, high = (size, high) if fits(size) else (low, size)
    if not low:
        raise ScenarioError(
            f"u_max {shown(bounds.tolist())} moves {rig.name} from its goal by less than "
            f"{high:.1g} of its amplitude: give more, or another keyframe"
        )
    return low


def motion_forces(rig: OwnRig, positions: Array, step: float) -> Array:
    """Return the forces of the driven joints in a motion, (driven, K'), every tenth sample."""
    plant = rig.numbers_of(Values(**rig.values))["plant"]
    driven = len(positions)
    v = np.gradient(positions, step, axis=1)
    a = np.gradient(v, step, axis=1)
    count = len(positions[0, ::FORCE_STRIDE])
    motion = np.zeros((3, count, plant.n))
    motion[0] = plant.rest or (0.0,) * plant.n
    for of_motion, of_driven in zip(motion, (positions, v, a), strict=True):
        of_motion[:, :driven] = of_driven[:, ::FORCE_STRIDE].T
    return inverse_dynamics.forces(plant, *motion)[:, :driven].T


def _motions(
    rig: OwnRig,
    names: list[str],
    moved: Mapping[str, Array],
    period: float,
    drives: Scenario,
    measured: tuple[float, Any],
) -> list[ExcitingMotion]:
    """Return what a log of each motion would tell; without those that the machine does not
    follow. Raise ScenarioError if it follows none. `measured`: noise, rad or m, and the encoders.
    """
    scenarios = []
    for positions in moved.values():
        scenarios.append(_played(rig, positions, period, drives, measured))
    motions = []
    for (name, positions), trace in zip(moved.items(), run(scenarios), strict=True):
        if not trace.failure:
            expected = _told(rig, names, trace)
            values = {}
            for quantity in names:
                values[quantity] = rig.values[quantity]
            motions.append(
                ExcitingMotion(
                    name=name,
                    times=tuple(trace.t.tolist()),
                    positions=tuple(map(tuple, positions.tolist())),
                    values=values,
                    largest_u=float(np.abs(trace.u).max()),
                    largest_v=float(np.abs(trace.v).max()),
                    rest=_rest(trace.v),
                    **expected,
                )
            )
    if not motions:
        raise ScenarioError(
            f"{rig.name} follows none of {', '.join(moved)}: give a smaller amplitude"
        )
    return motions


def _played(
    rig: OwnRig, positions: Array, period: float, drives: Scenario, measured: tuple[float, Any]
) -> Scenario:
    """Return the run of a motion of the driven joints, (driven, K)."""
    plant = rig.plant
    noise, sensor = measured
    times = (period * np.arange(positions.shape[1])).tolist()
    start = list(plant.rest or (0.0,) * plant.n)
    start[: plant.driven] = positions[:, 0].tolist()
    laws = []
    references = []
    for law, command in _commands(rig, positions, period, drives):
        laws.append(law)
        references.append(TimeSeries(times, command.tolist()))
    fields = rig.machine(Values(**rig.values)) | {
        "law": laws,
        "reference": references,
        "duration": times[-1],
        "control_period": period,
        "x0": tuple(start),
        "noise": Noise(position=noise),
        "sensor": sensor,
        "u_max": drives.limits,
    }
    step = period / math.ceil(period / PLAYED_STEP - 1e-9)
    late = round(fields.pop(DELAY, 0.0) / step) * step
    return Scenario.recorded(**fields | {DELAY: late, "physics_step": step})


def _commands(
    rig: OwnRig, positions: Array, period: float, drives: Scenario
) -> list[tuple[Law, Array]]:
    """Return the law of each driven joint, and the reference with which it follows a motion: of a
    servo the motion, as its set-point; of a PD law the motion and what makes up for the force that
    it takes.
    """
    inertias = _free_inertias(rig)
    forces = motion_forces(rig, positions, period)
    times = np.arange(positions.shape[1])
    w = 2.0 * math.pi * BANDWIDTH
    commands = []
    for i, motor in enumerate(drives.drive_train.motors):
        if isinstance(motor, PositionServo):
            set_point = positions[i] - motor.goal
            commands.append((as_recorded(), set_point))
            continue
        kp = w * w * inertias[i]
        kd = 2.0 * DAMPING_RATIO * w * inertias[i]
        gain = motor.nominal.gain
        law = find_law("pid", kp=kp / gain, ki=0.0, kd=kd / gain)
        needed = np.interp(times, times[::FORCE_STRIDE], forces[i])
        lead = _led(needed / kp, kd / kp / period)
        commands.append((law, positions[i] + lead))
    return commands


def _free_inertias(rig: OwnRig) -> list[float]:
    """Return the inertia that each joint shows at the goal while the others are free: a loop whose
    gains suit it is stable whatever the others do.
    """
    plant = rig.numbers_of(Values(**rig.values))["plant"]
    model = plant.load()
    data = mujoco.MjData(model)
    data.qpos[model.jnt_qposadr[joint_ids(model)]] = plant.rest or (0.0,) * plant.n
    mujoco.mj_forward(model, data)
    mobility = np.zeros((model.nv, model.nv))
    mujoco.mj_solveM(model, data, mobility, np.eye(model.nv))
    return (1.0 / np.diag(mobility)[dof_ids(model)]).tolist()


def _led(values: Array, samples: float) -> Array:
    """Return the signal z of which z and its rate, times a number of samples, add up to values."""
    z = values.copy()
    share = 1.0 - math.exp(-1.0 / samples)
    for k in range(len(z) - 1):
        z[k + 1] = z[k] + share * (values[k] - z[k])
    return z


def _told(rig: OwnRig, names: list[str], trace: Trace) -> dict[str, Any]:
    """Return the condition number, the expected errors and the worst pair of a log."""
    _, data = rig.reading([trace])
    replays = Replays(rig, names, data, False)
    true = Point(replays.start.values, _of_run(replays, rig, trace))
    slopes = _slopes(replays, true)
    check_told_apart(replays, slopes)
    (residuals,) = replays.residuals([true])
    slopes = dataclasses.replace(slopes, residuals=residuals)
    solved, by_steps = gauss_newton.extrapolated(replays, slopes)
    solved_rig = rig.with_values(replays.values(solved.point))
    may_lack = lack_of_fit(solved, presliding(solved_rig, replays, solved, INTEGRATOR))
    by_model = np.hypot(by_steps, may_lack.moved)
    errors, correlations = statistics(replays, solved, by_model)
    for name, error in errors.items():
        if math.isnan(error):
            errors[name] = math.inf
    return {
        "condition": _condition_number(solved.freed_slopes),
        "errors": errors,
        "worst_pair": _worst_pair(names, correlations),
    }


def _slopes(replays: Replays, point: Point) -> Slopes:
    """Return slopes at a point, by replays with long steps."""
    trial = copy.copy(replays)
    part = replays.pieces[0].part
    assert isinstance(part, LogPart)
    trial.steps = {"physics_step": part.held(LONG_STEP).period}
    return trial.slopes(point, central=False)


def _condition_number(J: Array) -> float:
    """Return the condition number of scaled slopes."""
    scaled = J / np.linalg.norm(J, axis=0)
    singular = np.linalg.svd(scaled, compute_uv=False)
    return float(singular[0] / max(singular[-1], 1e-300))


def _worst_pair(names: Sequence[str], correlations: Array) -> tuple[str, str, float]:
    """Return the two quantities whose errors correlate most; the second is "" if there is one."""
    apart = correlations - np.eye(len(names))
    largest = int(np.argmax(np.abs(apart)))
    i, j = divmod(largest, len(names))
    second = ""
    if len(names) > 1:
        second = names[j]
    return names[i], second, float(apart[i, j])


def _of_run(replays: Replays, rig: OwnRig, trace: Trace) -> Array:
    """Return the moves of the pieces' states to those that the machine had."""
    true = np.hstack([trace.x + rig.zeros, trace.v])
    states = []
    first = 0
    for piece in replays.pieces:
        assert piece.part is not None
        states.append((true[first] - piece.part.state) / piece.scales)
        first += len(next(iter(piece.measured.values()))) - 1
    return np.array(states)


def _rest(v: Array) -> float:
    """Return the share of samples at which every joint is slow, of speeds (K, n)."""
    speeds = np.abs(v)
    slow = speeds <= SLOW * speeds.max(axis=0)
    return float(np.mean(np.all(slow, axis=1)))
