"""Inverse dynamics: the torques that a measured motion takes, and the measured torques, both below
5 Hz.

Velocities and accelerations are those of cubics through the positions. The noise of an
acceleration, times the inertia, may exceed the torque itself. Least squares would then find too
small an inertia, which reduces that noise. So computed and measured torques go through the same
low-pass filter, forward and backward. Source: M. Gautier, "Dynamic identification of robots with
power model", IEEE ICRA 1997 (the parallel filter).
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.identification.records import Columns, Record, step_of
from smc_mujoco.mechanisms.layout import dof_ids, initial_pose, joint_ids
from smc_mujoco.mechanisms.plant import Plant

CUBIC_WINDOW, CUBIC_DEGREE = 0.04, 3  # s, and degree, of the cubic about each sample; chosen
# s, between the samples that are compared; chosen: the cubics leave nothing above 30 Hz
COMPARED_PERIOD = 0.01
# Hz, and number of poles, of the low-pass filter. Chosen: three times the fastest public exciting
# motions, 1.6 Hz.
CUTOFF = 5.0
POLES = 4
END_DURATION = 0.1  # s, left out at both ends, where the filter knows only one side; chosen
MIN_DURATION, MAX_STEP = 1.0, 0.05  # s: of a record, and between its samples; chosen


class Filter:
    """The filter of a record's columns at its own rate."""

    def __init__(self, data: Record, columns: Columns, cutoff: float = CUTOFF):
        """Make the filter of a record, of `cutoff` Hz."""
        from scipy.signal import butter

        t = data[columns.time]
        self.data = data
        self.step = step_of(t)
        if not long_enough(data, columns):
            raise ScenarioError(
                f"the record lasts {t[-1] - t[0]:.3g} s, with a sample every {self.step:.3g} s: "
                f"for its torques give at least {MIN_DURATION:g} s, with a sample every "
                f"{MAX_STEP:g} s or more often"
            )
        self.stride = max(1, round(COMPARED_PERIOD / self.step))
        self.poles = butter(POLES, cutoff, fs=1.0 / (self.stride * self.step), output="sos")

    def cubic(self, name: str, derivative: int = 0) -> Array:
        """Return a column or its derivative, (N,), at the samples that are compared, from cubics
        about each of them.
        """
        from scipy.signal import savgol_filter

        samples = cubic_samples(self.step)
        smooth = savgol_filter(
            self.data[name], samples, CUBIC_DEGREE, deriv=derivative, delta=self.step
        )
        return np.asarray(smooth)[:: self.stride]

    def motion(self, names: Sequence[str]) -> list[Array]:
        """Return columns, their rates and their second derivatives, (N, n) each."""
        derivatives = []
        for order in range(3):
            columns = [self.cubic(name, order) for name in names]
            derivatives.append(np.column_stack(columns))
        return derivatives

    def low(self, values: Array) -> Array:
        """Return the part of values (N,) below CUTOFF, without the ends."""
        from scipy.signal import sosfiltfilt

        return self.inner(sosfiltfilt(self.poles, values))

    def inner(self, values: Array) -> Array:
        """Return values (N,) without the ends."""
        cut = round(END_DURATION / (self.stride * self.step))
        return values[cut : len(values) - cut]


def cubic_samples(step: float) -> int:
    """Return how many samples of a record, `step` s apart, a cubic goes through."""
    return 2 * max(2, round(CUBIC_WINDOW / step / 2)) + 1


def times(data: Record, columns: Columns) -> Array:
    """Return the times at which torques are compared, s."""
    filtered = Filter(data, columns)
    return filtered.inner(data[columns.time][:: filtered.stride])


def measured_torque(data: Record, columns: Columns) -> Record:
    """Return the recorded torque of each joint, below CUTOFF, N m."""
    filtered = Filter(data, columns)
    torque_columns = {}
    for name in columns.torque:
        torque_columns[name] = filtered.low(filtered.cubic(name))
    return torque_columns


def long_enough(data: Record, columns: Columns) -> bool:
    """Return whether a record's torques can be compared."""
    t = data[columns.time]
    return bool(t[-1] - t[0] >= MIN_DURATION and step_of(t) <= MAX_STEP)


def torques(plant: Plant, data: Record, columns: Columns, cutoff: float = CUTOFF) -> Record:
    """Return the torque of each joint in the measured motion, below `cutoff` Hz, N m, by MuJoCo's
    inverse dynamics.
    """
    filtered = Filter(data, columns, cutoff)
    needed = forces(plant, *filtered.motion(columns.x))
    torque_columns = {}
    for i, name in enumerate(columns.torque):
        torque_columns[name] = filtered.low(needed[:, i])
    return torque_columns


def forces(plant: Plant, x: Array, v: Array, a: Array) -> Array:
    """Return the forces of a plant's channels in a motion: positions, speeds and accelerations,
    (N, n) each.
    """
    model = plant.load()
    state = mujoco.MjData(model)
    state.qpos[:] = initial_pose(model)  # of joints that are held
    places = model.jnt_qposadr[joint_ids(model)]
    dofs = dof_ids(model)
    needed = np.empty_like(x)
    for k in range(len(x)):
        state.qpos[places] = x[k]
        state.qvel[dofs] = v[k]
        state.qacc[dofs] = a[k]
        mujoco.mj_inverse(model, state)
        needed[k] = state.qfrc_inverse[dofs]
    return needed
