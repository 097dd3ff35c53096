"""Joints with friction, of the suites of tracking problems: M x'' = -G sin(x + off) - D x' + u + d.

`rail` is a mass on a slide. `link` is held by its motor at 0.8 rad against gravity, with 29 % of
the bound on u. Their friction is a part of each problem.
"""

import math
from functools import partial

import mujoco

from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import Field, Plant

GRAVITY = 9.81  # m/s^2
ARM = 0.05  # m, of the weight that makes the moment of gravity; the rest of M is armature
MODEL = """
<mujoco>
  <option timestep="0.001" integrator="RK4"/>
  <worldbody>
    <body name="link" pos="0 0 1">
      <joint name="joint" type="{kind}" axis="{axis}"/>
      <inertial pos="{x} 0 {z}" mass="1" diaginertia="1e-13 1e-13 1e-13"/>
    </body>
  </worldbody>
  <actuator><motor name="u" joint="joint"/></actuator>
  <sensor><jointpos name="x" joint="joint"/><jointvel name="v" joint="joint"/></sensor>
</mujoco>
"""


def _build(kind: str, off: float, n: int) -> mujoco.MjSpec:
    """Return the mechanism: a slide, or a link that hangs at x = -off."""
    del n
    numbers = {"axis": "1 0 0", "x": 0.0, "z": 0.0}
    if kind == "hinge":
        numbers = {"axis": "0 1 0", "x": -ARM * math.sin(off), "z": -ARM * math.cos(off)}
    return mujoco.MjSpec.from_string(MODEL.format(kind=kind, **numbers))


def _slide_fields(model, p):
    yield Field("body_mass", 1, p.M)
    yield Field("dof_damping", 0, p.D)


def _hinge_fields(model, p):
    yield Field("body_mass", 1, p.G / (GRAVITY * ARM))
    yield Field("dof_armature", 0, p.M - p.G * ARM / GRAVITY)
    yield Field("dof_damping", 0, p.D)


def _nominal(x, v, i, p):
    return (-p.G * math.sin(x[i] + p.off) - p.D * v[i]) / p.M, 1.0 / p.M


RAIL = Plant(
    name="rail",
    parameters={"M": 1.0, "D": 0.0, "G": 0.0, "off": 0.0},  # kg, N s/m, N, rad
    mass="M",
    unit="m",
    x0=(0.1,),
    build=partial(_build, "slide", 0.0),
    fields=_slide_fields,
    nominal=_nominal,
)
LINK = Plant(
    name="link",
    parameters={"M": 0.225, "D": 0.02, "G": 2.4525, "off": 0.8},  # kg m^2, N m s, N m, rad
    mass="M",
    unit="rad",
    x0=(0.5,),
    build=partial(_build, "hinge", 0.8),
    fields=_hinge_fields,
    nominal=_nominal,
)


def plant_of_problem(name: str) -> Plant:
    """Return the joint of a name, or the plant of the library."""
    return {"rail": RAIL, "link": LINK}.get(name) or as_plant(name)
