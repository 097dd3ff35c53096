"""Public logs of two machines of DFKI's Underactuated Lab (BSD-3) as columns, with their published
models as MJCF: the AK80-6 pendulum, and double pendulum C.1 with its model 1.0.
"""

from pathlib import Path

import numpy as np

M1, M2 = 0.5234602302310271, 0.6255677234174437  # kg
L1, R2 = 0.2, 0.25569305436052964  # m; the first link's centre of mass is at its end
I1, I2 = 0.031887199591513114, 0.05086984812807257  # kg m^2, about the joints
ROTORS = 36.0 * 6.287203962819607e-5  # kg m^2, behind a gear of 6
# N m: cf arctan(100 v) at speed, of the authors' models 1.0, 2.0 and 3.0
CF = {"shoulder": (0.16, 0.1747, 0.033), "elbow": (0.12, 0.11, 0.035)}
DRY = {joint: tuple(np.pi / 2.0 * cf for cf in fits) for joint, fits in CF.items()}
STILL = 'contype="0" conaffinity="0" mass="0" type="sphere" size=".02"'


def double_pendulum() -> str:
    """Return the MJCF of model 1.0, with a motor at each joint."""
    first, second = I1 - M1 * L1**2, I2 - M2 * R2**2
    joint = f'axis="0 1 0" damping=".001" armature="{ROTORS}"'
    return f"""<mujoco model="double_pendulum_c1"><compiler angle="radian"/><worldbody><body>
<joint name="shoulder" {joint} frictionloss="{DRY["shoulder"][0]}"/>
<inertial pos="0 0 -{L1}" mass="{M1}" diaginertia="{first} {first} 1e-5"/>
<geom pos="0 0 -{L1}" {STILL}/><body pos="0 0 -{L1}">
<joint name="elbow" {joint} frictionloss="{DRY["elbow"][0]}"/>
<inertial pos="0 0 -{R2}" mass="{M2}" diaginertia="{second} {second} 1e-5"/>
<geom pos="0 0 -{R2}" {STILL}/></body></body></worldbody>
<actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator></mujoco>"""


def double_pendulum_log(folder: Path, name: str, duration: float) -> dict[str, np.ndarray]:
    """Return the first seconds of record C1-sysid-NAME, with the measured torques as commands."""
    with np.load(folder / f"double_pendulum-C1-sysid-{name}.npz") as record:
        within = record["time"] < duration
        columns = {"t": record["time"][within]}
        for i, joint in enumerate(("shoulder", "elbow"), 1):
            columns[f"x_{joint}"] = record[f"pos_meas{i}"][within]
            columns[f"u_{joint}"] = record[f"tau_meas{i}"][within]
    return columns


def pendulum() -> str:
    """Return the MJCF of the AK80-6 pendulum, with a motor at joint j."""
    return f"""<mujoco model="ak80"><compiler angle="radian"/><worldbody><body>
<joint name="j" axis="0 1 0" frictionloss=".21"/>
<inertial pos="0 0 -.5" mass=".66" diaginertia="1e-4 1e-4 1e-4"/>
<geom pos="0 0 -.5" {STILL}/></body></worldbody>
<actuator><motor joint="j"/></actuator></mujoco>"""


def pendulum_log(folder: Path, name: str) -> dict[str, np.ndarray]:
    """Return a record of the AK80-6 pendulum, with the measured torque as the command."""
    with np.load(folder / f"simple_pendulum-{name}.npz") as record:
        return {"t": record["time"], "x": record["position"], "u": record["torque"]}
