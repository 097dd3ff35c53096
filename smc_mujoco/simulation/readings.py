"""What the encoders of a run read at its samples: a log of the machine has that, and no true
positions.
"""

import dataclasses
import math

import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.control.law import law_function
from smc_mujoco.mechanisms.hardware.beside_joint import BesideJoint
from smc_mujoco.simulation import philox
from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.time_series import TimeSeries
from smc_mujoco.simulation.trace import Trace


@law_function(family="baseline", continuous=True, accuracy=0, label="As recorded", colour="#6E7781")
def as_recorded(y, gains, memory):
    """u is the reference, a recorded command, and s what the sensor reads."""
    return y.r, y.x


def rotors_read(scenario: Scenario) -> tuple[int, ...]:
    """Return the driven channels whose encoder reads a rotor beside the joint."""
    beside = set()
    for part in scenario.actuator:
        if isinstance(part, BesideJoint):
            beside.update(part.channels(scenario.plant))
    channels = []
    for i in sorted(beside):
        sensor = scenario.encoder(i)
        if sensor is not None and sensor.side == "motor":
            channels.append(i)
    return tuple(channels)


def readings(trace: Trace, noisy: bool = True) -> Array:
    """Return the positions of a run as its encoders read them, (K + 1, n) rad or m: with bias,
    counts and, if `noisy`, the run's noise.

    Of an encoder on the motor side they are those of the rotor, by a run with the same commands,
    with the noise in any case. The sampling of other encoders has no delay, period or dropout here.
    """
    s = trace.scenario
    x = trace.x.copy()
    for i in range(x.shape[1]):
        sensor = s.encoder(i)
        if sensor is not None:
            x[:, i] += sensor.bias
        if noisy and s.noise.position:
            normals = []
            for k in range(len(x)):
                normals.append(philox.normals(s.seed, i, philox.MEASUREMENT, k)[0])
            x[:, i] += s.noise.position * np.array(normals)
        if sensor is not None and (quantum := sensor.quantum(s.plant.units[i] == "rad")):
            x[:, i] = quantum * np.floor(x[:, i] / quantum + 0.5)
    rotors = list(rotors_read(s))
    if rotors:
        x[:, rotors] = _repeated(trace).s[:, rotors]
    return x


def measured(trace: Trace) -> Trace:
    """Return a run as its encoders saw it, as a log of a machine has it:

        scenario = smc.Scenario(plant="duffing", law="pid", sensor=smc.Encoder(1024), duration=0.5)
        smc.measured(smc.run(scenario)).export("log.csv")

    x is what the law of the run read: with bias, counts, noise, delay and what was lost, and on the
    motor's side of a play or a spring the rotor. All else stays, also v, the true rate. Its scores
    would be those of the readings.

    Args:
      trace: of `run`.

    Returns:
      A Trace with another x, (K + 1, n), rad or m.
    """
    s = trace.scenario
    x = readings(trace)
    late = []
    for i in range(s.plant.driven):
        sensor = s.encoder(i)
        if sensor and (sensor.delay or sensor.skew or sensor.period or sensor.dropout):
            late.append(i)
    if late:
        x[:, late] = _repeated(trace).s[:, late]
    return dataclasses.replace(trace, x=x)


def _repeated(trace: Trace) -> Trace:
    """Return the run of a trace with its commands, whose s is what its sensors read."""
    s = trace.scenario
    if s.law.function is as_recorded.function:
        return trace
    times = trace.t.tolist()
    references = []
    for i in range(s.plant.driven):
        references.append(TimeSeries(times, trace.u[:, i].tolist()))
    repeated = dataclasses.replace(
        s, law=as_recorded(), reference=tuple(references), feedforward=None, u_max=math.inf
    )
    return run(repeated)
