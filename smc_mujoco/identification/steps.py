"""A plant from a step log: gain, time constants and delay, each with its standard error.

    tracks="speed"      v = K u(t - L) / ((T s + 1) (T2 s + 1))          v: the joint's speed
    tracks="position"   x = K u(t - L) / (T^2 s^2 + 2 D T s + 1)         x: its position

T2, the lag of the motor, is left out where the log does not show it. The plant is a joint with that
inertia, damping and spring, behind that lag and that delay. So laws hold its position as on any
plant, or its speed in a scenario with tracks="speed".
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Annotated, Any

import numpy as np

from smc_mujoco.common.aliases import Array, Numbers
from smc_mujoco.common.constraints import OneOf, Positive, constrained
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.identification import number_text, records
from smc_mujoco.identification.records import Record
from smc_mujoco.identification.standard_errors import correlation_time
from smc_mujoco.mechanisms.custom.plant_from import plant_from
from smc_mujoco.mechanisms.plant import Plant

TRACKED = {"speed": ("v", "speed", "y"), "position": ("x", "position", "y")}  # column's names
UNITS = {"delay": "s", "time_constant": "s", "lag": "s", "damping_ratio": ""}
FINER = 4  # steps of the response in a sample of the log; chosen
TINY = 1e-300
MIN_SAMPLES = 50  # of a log; chosen
GRID = 16  # time constants, and delays, from which the search starts; chosen
MOST_LATE = 0.25  # of the log, of a delay; chosen
LEAST_FIT = 30.0  # percent: below it the response does not follow u; chosen
SHOWS = 4.0  # errors, from which a lag is kept; chosen
DELAY_STEP = 1e-3  # s, longest step of the file's delay; chosen
Response = Callable[[Array], tuple[Array, Array]]  # shape -> numerator and denominator


@keyword_dataclass
class StepModel:
    """What a step log says of a machine.

    Attributes:
      values: number -> its value in SI units: gain, time_constant, lag or damping_ratio, delay.
      errors: number -> its standard error.
      fit: percent, as of `identify`.
      notes: what to doubt.
      tracks: "speed" or "position".
      u_max: the largest |u| of the log.
    """

    values: Numbers
    errors: Numbers
    fit: float
    notes: tuple[str, ...]
    tracks: str
    u_max: float

    def __str__(self) -> str:
        units = {name: UNITS.get(name, "") for name in self.values}
        lines = number_text.table(self.values, self.errors, units)
        return "\n".join([*lines, f"fits {self.fit:.1f} %", *self.notes])


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class StepPlant(Plant):
    """A plant from a step log, with what the log says: `print(plant.model)`."""

    model: StepModel


@constrained
def plant_from_steps(
    log: Any,
    tracks: Annotated[str, OneOf(names=tuple(TRACKED))] = "speed",
    *,
    columns: Mapping[str, str] | None = None,
    u_max: Positive | None = None,
    name: str = "steps",
) -> StepPlant:
    """Make a plant of a step log: its gain, time constants and delay, with standard errors.

        t = 0.01 * np.arange(300)
        on = t >= 0.5
        log = {"t": t, "u": 1.0 * on, "v": 2.0 * on * (1.0 - np.exp(-(t - 0.5) / 0.3))}
        motor = smc.plant_from_steps(log, tracks="speed")
        print(motor.model)
        trace = smc.run(smc.Scenario(plant=motor, law="pid", duration=1.0))

    Args:
      log: the path of a CSV or npz file, a data frame, or columns by name: t in s, u as the machine
        takes it, and v (rad/s) or x (rad), each (K,). u is held from its row to the next. One step
        or several, from rest.
      tracks: what the response is: "speed" or "position".
      columns: our name of a column -> that of the log.
      u_max: bound on |u|; default: the largest of the log.
      name: of the plant.

    Returns:
      A Plant of one joint, for Scenario, compare, which, tune and export. `model` has the numbers
      with their errors, the fit, and what to doubt.

    Raises:
      ScenarioError: a column is missing; u does not step; the response does not follow it, or does
        not come to rest.
    """
    record = _checked(records.as_columns(log, columns), tracks)
    model = fitted(record, tracks)
    bound = float(np.abs(record["u"]).max()) if u_max is None else u_max
    plant = plant_from(_mjcf(model, bound), ["joint"], name=name)
    fields = {field.name: getattr(plant, field.name) for field in dataclasses.fields(plant)}
    return StepPlant(**fields, model=model)


def _checked(log: Any, tracks: str) -> Record:
    """Return t, u and y of a log at even times."""
    if not isinstance(log, Mapping):
        raise ScenarioError(f"log is {shown(log)}: give a file, or columns t, u and {tracks[0]}")
    names = [name for name in TRACKED[tracks] if name in log]
    if not names:
        names = [TRACKED[tracks][0]]
    needed = records.Columns(x=(names[0],), u="u")
    data = records.checked(log, needed, None, "steps")
    y, u = data[names[0]], data["u"]
    if len(y) < MIN_SAMPLES:
        raise ScenarioError(f"the log has {len(y)} samples: give {MIN_SAMPLES} or more")
    if not np.ptp(u):
        raise ScenarioError("u of the log does not step: record a response to a step of u")
    return {"t": data["t"] - data["t"][0], "u": u, "y": y}


def fitted(record: Record, tracks: str) -> StepModel:
    """Return the model of a log with columns t, u and y."""
    step = records.step_of(record["t"])
    lasts = float(record["t"][-1])
    if tracks == "speed":
        shapes: dict[str, tuple[tuple[str, ...], Response]] = {
            "one": (("time_constant",), lambda p: (np.ones(1), np.array([p[0], 1.0]))),
            "two": (
                ("time_constant", "lag"),
                lambda p: (np.ones(1), np.polymul([p[0], 1.0], [p[1], 1.0])),
            ),
        }
    else:
        shapes = {
            "two": (
                ("time_constant", "damping_ratio"),
                lambda p: (np.ones(1), np.array([p[0] ** 2, 2.0 * p[0] * p[1], 1.0])),
            )
        }
    fits = []
    for names, response in shapes.values():
        fits.append(_least_squares(record, names, response, step, lasts))
    best = fits[0]
    for lagged in fits[1:]:  # the lag must show beyond its error
        if lagged[0]["lag"] > SHOWS * lagged[1]["lag"] and lagged[2] < best[2]:
            best = lagged
    values, errors, norm = best
    y = record["y"]
    fit = 100.0 * (1.0 - norm / float(np.linalg.norm(y - y.mean())))
    if fit < LEAST_FIT:
        raise ScenarioError(
            f"the response does not follow u: the best fit is {fit:.0f} %: check the columns, and "
            "record a larger step"
        )
    if values["time_constant"] > lasts:
        raise ScenarioError(
            f"the response does not come to rest within the log of {lasts:.3g} s: record longer "
            "steps" + (', or give tracks="speed"' if tracks == "position" else "")
        )
    notes = []
    for name, value in values.items():
        if name != "delay" and errors[name] > abs(value):
            notes.append(f"the log hardly shows {name}: record faster samples, or a larger step")
    return StepModel(
        values=values,
        errors=errors,
        fit=fit,
        notes=tuple(notes),
        tracks=tracks,
        u_max=float(np.abs(record["u"]).max()),
    )


def _least_squares(
    record: Record, names: tuple[str, ...], response: Response, step: float, lasts: float
) -> tuple[dict[str, float], dict[str, float], float]:
    """Return values, standard errors, and the norm of the residuals."""
    from scipy.optimize import least_squares

    u = np.repeat(record["u"] - record["u"][0], FINER)
    y = record["y"]
    fine = step / FINER * np.arange(len(u))

    def unit_response(p: Array, late: float) -> Array:
        """Return the response of a gain of 1, (K,)."""
        return np.interp(record["t"] - late, fine, filtered(response(p), u, step / FINER))

    def solved(moved: Array) -> tuple[Array, Array]:
        """Return gain and offset of least squares, and what is left, (K,)."""
        about, of_y = moved - moved.mean(), y - y.mean()
        gain = float(about @ of_y) / max(float(about @ about), TINY)
        return np.array([gain, y.mean() - gain * moved.mean()]), of_y - gain * about

    starts = []
    for constant in np.geomspace(step, lasts / 2.0, GRID):
        p = np.array([constant, 1.0 if "damping_ratio" in names else constant / 5.0])[: len(names)]
        moved = filtered(response(p), u, step / FINER)
        for late in np.linspace(0.0, MOST_LATE * lasts, GRID):
            _, rest = solved(np.interp(record["t"] - late, fine, moved))
            starts.append((float(rest @ rest), *p, late))
    first = np.array(min(starts)[1:])
    low = [step / 100.0] * len(names) + [0.0]
    high = [10.0 * lasts] * len(names) + [MOST_LATE * lasts]
    solution = least_squares(
        lambda q: solved(unit_response(q[:-1], q[-1]))[1],
        np.clip(first, low, high),
        bounds=(low, high),
        x_scale=np.maximum(first, step),
        diff_step=1e-3,
    )
    shape, late = solution.x[:-1], float(solution.x[-1])
    linear, residuals = solved(unit_response(shape, late))
    if names[-1] == "lag" and shape[1] > shape[0]:
        shape = shape[::-1]
    values = {"gain": float(linear[0])} | dict(zip(names, shape.tolist(), strict=True))
    values["delay"] = late
    # by all numbers together, with as many samples as are independent of each other
    columns = []
    parameters = np.array([linear[0], *solution.x[:-1], late, linear[1]])
    for k, value in enumerate(parameters):
        moved = parameters.copy()
        moved[k] += 1e-3 * max(abs(value), step)
        predicted = moved[0] * unit_response(moved[1:-2], moved[-2]) + moved[-1]
        columns.append((predicted - (y - residuals)) / (moved[k] - value))
    J = np.column_stack(columns)
    variance = np.sum(residuals**2) / (len(y) - J.shape[1]) * max(1.0, correlation_time(residuals))
    covariance = variance * np.linalg.pinv(J.T @ J)
    deviations = np.sqrt(np.diag(covariance))[:-1]
    order = ["gain", *names, "delay"]
    errors = dict(zip(order, deviations.tolist(), strict=True))
    return values, errors, float(np.linalg.norm(residuals))


def filtered(system: tuple[Array, Array], u: Array, step: float) -> Array:
    """Return the response of a transfer function to commands that are held, exactly."""
    from scipy.signal import cont2discrete, lfilter

    discrete: Any = cont2discrete(system, step)
    return np.asarray(lfilter(np.ravel(discrete[0]), discrete[1], u))


def _mjcf(model: StepModel, u_max: float) -> str:
    """Return a joint with the inertia, the damping and the spring of a model."""
    values = dict(model.values)
    gain = values["gain"]
    size = abs(gain)
    T = values["time_constant"]
    if model.tracks == "speed":
        inertia, damping, spring = T / size, 1.0 / size, 0.0
    else:
        inertia, damping, spring = T**2 / size, 2.0 * values["damping_ratio"] * T / size, 1.0 / size
    motor = f'gear="{np.sign(gain):g}" ctrllimited="true" ctrlrange="{-u_max!r} {u_max!r}"'
    option = ""
    if late := values["delay"]:
        count = max(1, round(late / DELAY_STEP))
        option = f' timestep="{late / count!r}"'
        motor += f' delay="{late!r}" nsample="{count + 2}"'
    kind = f'<motor joint="joint" {motor}/>'
    if lag := values.get("lag"):
        kind = f'<general joint="joint" dyntype="filterexact" dynprm="{lag!r}" {motor}/>'
    return f"""<mujoco model="steps"><compiler angle="radian"/><option gravity="0 0 0"{option}/>
<worldbody><body><joint name="joint" axis="0 0 1" damping="{damping!r}" stiffness="{spring!r}"
armature="{inertia!r}"/><geom type="capsule" fromto="0 0 0 .2 0 0" size=".02" mass="1e-9"
contype="0" conaffinity="0"/></body></worldbody><actuator>{kind}</actuator></mujoco>"""
