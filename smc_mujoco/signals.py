"""References and disturbances beyond those at the root: pulses, paths, gusts, recorded series."""

from smc_mujoco.simulation.signals import BandLimited, Gust, Impulse, MinimumJerk, OrnsteinUhlenbeck, Pulse, Ramp, Relay
from smc_mujoco.simulation.time_series import Held, TimeSeries, Waypoints, cartesian_path

__all__ = [
    "BandLimited", "Gust", "Held", "Impulse", "MinimumJerk", "OrnsteinUhlenbeck", "Pulse", "Ramp", "Relay",
    "TimeSeries", "Waypoints", "cartesian_path",
]  # fmt: skip
