"""References and disturbances beyond those at the root: pulses, paths, gusts, wind, recorded
series.
"""

from smc_mujoco.simulation.signals import (
    BandLimited,
    Dryden,
    Gust,
    Impulse,
    MinimumJerk,
    OrnsteinUhlenbeck,
    Pulse,
    Push,
    Ramp,
    Relay,
    Sum,
    Wind,
)
from smc_mujoco.simulation.time_series import Held, TimeSeries, Waypoints, cartesian_path

__all__ = [
    "BandLimited",
    "Dryden",
    "Gust",
    "Held",
    "Impulse",
    "MinimumJerk",
    "OrnsteinUhlenbeck",
    "Pulse",
    "Push",
    "Ramp",
    "Relay",
    "Sum",
    "TimeSeries",
    "Waypoints",
    "Wind",
    "cartesian_path",
]
