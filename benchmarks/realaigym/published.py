"""Published rows of RealAIGym's simulation boards of pendubot and acrobot.

Sources: the boards of github.com/dfki-ric-underactuated-lab/real_ai_gym_leaderboard (the double
pendulum's software and boards are BSD-3-Clause), as they stood after the AI Olympics at IROS 2024;
archived_leaderboards/ has version 1, and leaderboards/icra2025 version 3, of April 2025. The
machines of versions 2 and 3 are design C.1, model 1.1, and so are this package's. Those of version
1 had other parameters.
"""

from collections.abc import Mapping
from typing import NamedTuple

SOURCE = (
    "RealAIGym leaderboards, DFKI Robotics Innovation Center, github.com/dfki-ric-underactuated-lab"
)


class Row(NamedTuple):
    """An entry of a simulation board: the criteria of its run, in SI units, and its score."""

    name: str
    swing_up_time: float
    energy: float
    torque_cost: float
    torque_smoothness: float
    velocity_cost: float
    score: float
    max_torque: float | None = None  # only version 1 has this one and the next
    integrated_torque: float | None = None


class RobustnessRow(NamedTuple):
    """An entry of a robustness board: percent of survived cases of each test, and the mean of all
    tests in 0 .. 1.
    """

    name: str
    model: float
    velocity_noise: float
    torque_noise: float
    torque_response: float
    delay: float
    perturbations: float
    score: float


class GlobalRow(NamedTuple):
    """An entry of a board of 2025: how often the tip rose above the line, how long it was there, s,
    and the score.
    """

    name: str
    swing_ups: float
    uptime: float
    score: float


SIMULATION: Mapping[str, Mapping[str, tuple[Row, ...]]] = {
    "acrobot": {
        "v2": (
            Row("History SAC", 1.00, 8.08, 1.80, 0.010, 88.5, 0.655),
            Row("AR-EAPO", 1.39, 8.32, 1.52, 0.008, 117.96, 0.633),
            Row("evolsac", 0.96, 9.26, 2.71, 0.030, 96.56, 0.524),
            Row("TVLQR", 4.05, 10.43, 1.87, 0.016, 105.83, 0.504),
            Row("iLQR Riccati Gains", 4.04, 10.55, 1.98, 0.067, 106.49, 0.396),
            Row("iLQR MPC stabilization", 4.86, 11.54, 2.68, 0.096, 110.4, 0.345),
            Row("mcpilco", 1.45, 19.43, 3.22, 0.097, 253.59, 0.316),
        ),
        "v1": (
            Row("mcpilco", 1.10, 9.81, 2.27, 0.057, 242.44, 0.869, 2.82, 1.27),
            Row("iLQR Riccati Gains", 4.15, 10.69, 2.20, 0.013, 99.16, 0.831, 3.01, 2.35),
            Row("SAC LQR", 1.55, 24.86, 10.32, 0.558, 158.35, 0.811, 4.98, 3.72),
            Row("iLQR MPC stabilization", 4.15, 10.80, 2.34, 0.076, 99.12, 0.806, 4.47, 2.61),
            Row("TVLQR", 3.98, 10.92, 2.47, 0.077, 100.34, 0.800, 5.00, 2.27),
            Row("iLQR MPC", 1.47, 29.62, 12.16, 0.046, 175.52, 0.796, 6.00, 3.47),
            Row("Energy PFL", 4.12, 29.01, 18.79, 0.251, 280.81, 0.728, 5.00, 7.12),
        ),
    },
    "pendubot": {
        "v2": (
            Row("History SAC", 1.15, 7.67, 2.36, 0.007, 62.07, 0.682),
            Row("AR-EAPO", 1.15, 7.72, 2.43, 0.010, 64.33, 0.659),
            Row("evolsac", 0.71, 9.83, 4.37, 0.014, 58.15, 0.596),
            Row("iLQR Riccati Gains", 4.13, 9.53, 1.25, 0.005, 211.34, 0.536),
            Row("TVLQR", 4.13, 9.53, 1.26, 0.007, 211.12, 0.526),
            Row("mcpilco", 1.14, 8.35, 2.42, 0.054, 114.26, 0.480),
            Row("iLQR MPC stabilization", 4.12, 9.91, 1.77, 0.083, 211.98, 0.353),
        ),
        "v1": (
            Row("mcpilco", 1.43, 12.67, 7.77, 0.070, 94.68, 0.891, 2.40, 3.48),
            Row("SAC LQR", 0.66, 9.29, 8.51, 0.174, 44.99, 0.876, 5.00, 2.14),
            Row("iLQR MPC", 0.65, 9.98, 10.56, 0.026, 44.16, 0.861, 6.00, 2.39),
            Row("iLQR Riccati Gains", 4.20, 9.06, 1.97, 0.008, 137.2, 0.847, 1.66, 2.64),
            Row("iLQR MPC stabilization", 4.19, 9.14, 2.04, 0.019, 136.95, 0.845, 1.75, 2.80),
            Row("TVLQR", 4.20, 9.06, 2.00, 0.031, 137.31, 0.827, 2.82, 2.57),
            Row("DQN LQR", 1.95, 14.44, 25.44, 1.452, 34.79, 0.815, 5.00, 5.92),
            Row("Energy PFL", 4.80, 53.75, 33.06, 0.136, 870.16, 0.594, 3.00, 12.28),
        ),
    },
}
ROBUSTNESS: Mapping[str, tuple[RobustnessRow, ...]] = {
    "acrobot": (
        RobustnessRow("History SAC", 58.1, 23.8, 100.0, 100.0, 90.5, 78.0, 0.751),
        RobustnessRow("AR-EAPO", 67.6, 28.6, 100.0, 100.0, 76.2, 64.0, 0.727),
        RobustnessRow("evolsac", 64.8, 23.8, 100.0, 100.0, 47.6, 76.0, 0.687),
        RobustnessRow("TVLQR", 48.1, 19.0, 100.0, 95.2, 23.8, 78.0, 0.607),
        RobustnessRow("iLQR MPC stabilization", 6.7, 9.5, 90.5, 52.4, 4.8, 42.0, 0.343),
        RobustnessRow("mcpilco", 9.0, 9.5, 19.0, 52.4, 4.8, 50.0, 0.241),
        RobustnessRow("iLQR Riccati Gains", 4.8, 9.5, 9.5, 52.4, 4.8, 2.0, 0.138),
    ),
    "pendubot": (
        RobustnessRow("AR-EAPO", 87.6, 81.0, 100.0, 100.0, 81.0, 98.0, 0.913),
        RobustnessRow("evolsac", 75.2, 57.1, 100.0, 100.0, 71.4, 68.0, 0.786),
        RobustnessRow("History SAC", 68.1, 47.6, 100.0, 100.0, 100.0, 46.0, 0.770),
        RobustnessRow("TVLQR", 62.9, 90.5, 100.0, 100.0, 42.9, 64.0, 0.767),
        RobustnessRow("iLQR MPC stabilization", 31.9, 90.5, 100.0, 100.0, 38.1, 44.0, 0.674),
        RobustnessRow("mcpilco", 24.8, 76.2, 61.9, 95.2, 28.6, 82.0, 0.614),
        RobustnessRow("iLQR Riccati Gains", 5.2, 38.1, 9.5, 85.7, 14.3, 0.0, 0.255),
    ),
}
GLOBAL: Mapping[str, tuple[GlobalRow, ...]] = {
    "acrobot": (
        GlobalRow("AR-EAPO", 21, 39.484, 0.658),
        GlobalRow("VIMPPI", 16, 38.882, 0.648),
        GlobalRow("AcadosMpc", 21, 37.798, 0.630),
        GlobalRow("mcpilco", 34, 18.408, 0.307),
        GlobalRow("prx_analytical", 14, 7.002, 0.117),
    ),
    "pendubot": (
        GlobalRow("VIMPPI", 16, 47.926, 0.799),
        GlobalRow("AR-EAPO", 16, 45.538, 0.759),
        GlobalRow("AcadosMpc", 16, 43.554, 0.726),
        GlobalRow("mcpilco", 23, 30.550, 0.509),
        GlobalRow("prx_analytical", 13, 14.396, 0.240),
    ),
}
