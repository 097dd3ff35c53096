"""References through waypoints: of a joint, and of a tip in space by inverse kinematics."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from smc_mujoco.common.errors import ScenarioError, number, shown
from smc_mujoco.mechanisms.hardware.part import joint_names
from smc_mujoco.mechanisms.inverse_kinematics import Tip, solve
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.time_series import TimeSeries, last_before

KNOT_SPACING = 0.01  # s, of a path in space; chosen: between knots the tip leaves its path by micrometres
MAX_KNOTS = 1_000_000  # of a path in space: minutes of computing


@dataclasses.dataclass(frozen=True, repr=False)
class Waypoints(TimeSeries):
    """The minimum-jerk motion through the points (times, values), at rest before the first and after the last.

    No other function through them, at rest at both ends, has a smaller integral of the squared jerk: it is the spline
    of fifth degree whose fourth derivative is continuous. It does not stop at inner points. With two points it is
    `MinimumJerk`.
    Source: I. J. Schoenberg, "Spline functions and the problem of graduation", Proc. Natl. Acad. Sci. 52(4):947, 1964.

    Attributes:
      times: (N,), s, increasing, N >= 2.
      values: (N,), rad or m.
      data: times, values and the spline's first and second derivative there, (4, N) float64, read-only.
    """

    rows = 4

    def _data(self) -> np.ndarray:
        from scipy.interpolate import make_interp_spline

        rest = [(1, 0.0), (2, 0.0)]
        spline = make_interp_spline(self.times, self.values, k=5, bc_type=(rest, rest))
        data = np.array([self.times, self.values, spline(self.times, 1), spline(self.times, 2)])
        data[2:, [0, -1]] = 0.0
        return data

    @staticmethod
    def value(t, p, data):
        last = data.shape[1] - 1
        if t <= data[0, 0]:
            return data[1, 0], 0.0, 0.0
        if t >= data[0, last]:
            return data[1, last], 0.0, 0.0
        low = last_before(data, t, last, 1.0)
        high = low + 1
        # quintic through both ends: r = r0 + v0 T a + a0 T^2 a^2 / 2 + c3 a^3 + c4 a^4 + c5 a^5, a = (t - t0) / T
        T = data[0, high] - data[0, low]
        a = (t - data[0, low]) / T
        v0, v1 = data[2, low] * T, data[2, high] * T
        a0, a1 = data[3, low] * T * T, data[3, high] * T * T
        # what is missing at the end, in position, velocity and acceleration, without c3, c4 and c5
        dr_end, dv_end, da_end = data[1, high] - data[1, low] - v0 - 0.5 * a0, v1 - v0 - a0, a1 - a0
        c3 = 10.0 * dr_end - 4.0 * dv_end + 0.5 * da_end
        c4 = -15.0 * dr_end + 7.0 * dv_end - da_end
        c5 = 6.0 * dr_end - 3.0 * dv_end + 0.5 * da_end
        r = data[1, low] + a * (v0 + a * (0.5 * a0 + a * (c3 + a * (c4 + a * c5))))
        dr = v0 + a * (a0 + a * (3.0 * c3 + a * (4.0 * c4 + a * 5.0 * c5)))
        ddr = a0 + a * (6.0 * c3 + a * (12.0 * c4 + a * 20.0 * c5))
        return r, dr / T, ddr / (T * T)


def cartesian_path(
    plant: Plant | str,
    times: Sequence[float],
    points: Sequence[Sequence[float]],
    site: str | None = None,
    body: str | None = None,
    orientation: Sequence[float] | None = None,
    x0: Sequence[float] | None = None,
    step: float = KNOT_SPACING,
) -> list[Waypoints]:
    """Return a reference for each channel's joint, on which a tip moves through points in space with minimum jerk.

    Inverse kinematics computes the joints' positions every `step`: least squares with MuJoCo's Jacobians, damped near
    singular poses. If an arm has more joints than the task needs, each solution is the one nearest to the one before.
    Then a closed path of the tip may not close in the joints.

    Args:
      plant: a plant or its name; its nominal model is used.
      times: (N,), s, increasing.
      points: (N, 3), m, in the world.
      site, body: name of the site or body whose origin is the tip; one of them.
      orientation: of the tip all along, a quaternion (w, x, y, z) in the world; None: any.
      x0: positions at which the search begins, one for each channel; None: the plant's.
      step: s.

    Raises:
      ScenarioError: an unknown plant, site or body, numbers out of range, or a point out of reach.
    """
    plant = as_plant(plant)
    if plant.free:
        raise ScenarioError(f"{plant.name} has joints without an actuator: a path in space needs all of them driven")
    if (site is None) == (body is None):
        model = plant.load()
        example = f"site={plant.tip!r}" if plant.tip else f"body={model.body(model.nbody - 1).name!r}"
        raise ScenarioError(f"site is {shown(site)} and body is {shown(body)}: give one of them, such as {example}")
    try:
        array = np.asarray(points, float)
    except (TypeError, ValueError, OverflowError):  # no numbers, or rows of unequal lengths
        array = np.empty(0)
    if array.shape != (len(times), 3):
        raise ScenarioError(
            f"points are {shown(points)}: give a position (x, y, z) in m for each of {len(times)} times"
        )
    path = [Waypoints(times, array[:, i].tolist()) for i in range(3)]
    step, first, last = number("step", step, above=0.0), path[0].times[0], path[0].times[-1]
    steps = (last - first) / step
    if steps > MAX_KNOTS:
        raise ScenarioError(f"step {step:g} s divides {last - first:g} s into {steps:.3g} steps: give a longer step")
    knots = np.linspace(first, last, max(2, int(np.ceil(steps - 1e-9)) + 1))
    positions = np.array([[Waypoints.value(t, None, axis.data)[0] for axis in path] for t in knots])
    start = plant.x0 if x0 is None else tuple(number("x0", x) for x in x0)
    if len(start) != plant.n:
        raise ScenarioError(f"x0 has {len(start)} values for {plant.n} channels: give {plant.n}")
    tip = Tip(plant, joint_names(plant), site, body, orientation)
    joints = solve(tip, positions, start)
    return [Waypoints(knots.tolist(), joints[:, i].tolist()) for i in range(plant.n)]
