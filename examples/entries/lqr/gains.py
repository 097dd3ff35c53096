"""Write entry.toml, with the gains of python-control's LQR for each plant's linear model: pip
install control.
"""

from pathlib import Path

import control
import numpy as np

import smc_mujoco as smc

HEAD = """\
name = "lqr of python-control"
authors = ["The smc_mujoco developers"]
source = "python-control 0.10.2, control.lqr"
licence = "Apache-2.0"
division = "free"
"""
PLANTS = (
    "inverted_pendulum",
    "van_der_pol",
    "duffing",
    "pendulum_network",
    "inverted_pendulum_network",
)

text = HEAD
for plant in PLANTS:
    system = smc.design.state_space(plant)
    n = system.ninputs
    gain = control.lqr(system, np.diag([100.0] * n + [1.0] * n), np.eye(n))[0]
    text += f"\n[gains.{plant}]\nk1 = {gain[0, 0]:.4f}\nk2 = {gain[0, n]:.4f}\n"
Path(__file__).with_name("entry.toml").write_text(text, encoding="utf-8")
