"""Conditions of flight, in which a report compares the laws that hold a quadrotor."""

from typing import Any

from smc_mujoco.simulation.signals import Constant, Dryden, Noise, Sine, Wind

W = 6.2832 / 4.0  # rad/s, of a figure of eight in 4 s
EIGHT = (Sine(1.0, W), Sine(0.5, 2.0 * W), Constant(1.0), *[Constant(0.0)] * 3)
CONDITIONS: dict[str, dict[str, Any]] = {
    "noise of 10 mm and 50 mm/s": {"noise": Noise(0.01, 0.05)},
    "delay of 5 ms": {"input_delay": 5e-3},
    "steady wind of 3 m/s": {"disturbance": Wind(3.0)},
    "gust of 6 m/s for 1 s": {"disturbance": Wind(6.0, time=4.5, width=1.0)},
    "turbulence on 3 m/s": {"disturbance": (Wind(3.0), Dryden(15.0, speed=3.0))},
    "payload of 19 %": {"mismatch": {"payload": 0.006}},
    "weak battery": {"mismatch": {"sag": 0.32}},
    "a rotor loses 20 %": {"mismatch": {"fade": 0.2}},
    "rotors with a lag of 0.1 s": {"mismatch": {"rise": 0.625, "fall": 0.625}},
    "figure of eight in 4 s": {"reference": EIGHT, "v0": (W, W, 0.0, 0.0, 0.0, 0.0)},
}
