"""Two plants whose numbers were drawn at random, to check the sentences of
docs/where_sliding_mode_loses.md on them.

    python -m benchmarks.fronts benchmarks/drawn_plants.py:drawn_pendulum --draw SEED --search 11

SEED is that of the draw, the first seven digits of the hash that git gave benchmarks/fronts.py when
its code was fixed (git hash-object). A mass on a spring: M x'' = -k x - b x' + u + d. A pendulum, m
l^2 x'' = m g l sin x - b x' + u + d, that stands or hangs; one that half of u_max cannot hold is
drawn again.
"""

import math

import mujoco
import numpy as np

from smc_mujoco.mechanisms.plant import Field, Plant

SEED, GRAVITY, HELD = 221691748, 9.81, 3.0  # of the draw; m/s^2; N m
MODEL = """
<mujoco>
  <option timestep="0.001" integrator="RK4"/>
  <worldbody>
    <body pos="0 0 1">
      <joint name="x" type="{kind}" axis="{axis}"/>
      <inertial pos="0 0 {height}" mass="1" diaginertia="1e-13 1e-13 1e-13"/>
    </body>
  </worldbody>
  <actuator><motor name="u" joint="x"/></actuator>
  <sensor><jointpos name="x" joint="x"/><jointvel name="v" joint="x"/></sensor>
</mujoco>
"""
rng = np.random.default_rng(SEED)


def even(low: float, high: float) -> float:
    """Return a number between two, to three digits."""
    return float(f"{rng.uniform(low, high):.3g}")


def even_ratio(low: float, high: float) -> float:
    """Return a number between two, of which equal ratios are equally likely."""
    return float(f"{math.exp(rng.uniform(math.log(low), math.log(high))):.3g}")


def slide(n):
    return mujoco.MjSpec.from_string(MODEL.format(kind="slide", axis="1 0 0", height=0.0))


def slide_fields(model, p):
    yield Field("body_mass", 1, p.M)
    yield Field("jnt_stiffness", 0, p.k)
    yield Field("dof_damping", 0, p.b)


def slide_nominal(x, v, i, p):
    return (-p.b * v[i] - p.k * x[i]) / p.M, 1.0 / p.M


def hinge(n):
    return mujoco.MjSpec.from_string(MODEL.format(kind="hinge", axis="0 1 0", height=height))


def hinge_fields(model, p):
    yield Field("body_mass", 1, p.m)
    yield Field("dof_damping", 0, p.b)


def hinge_nominal(x, v, i, p):
    return (p.m * GRAVITY * p.h * math.sin(x[i]) - p.b * v[i]) / (p.m * p.h**2), 1.0 / (
        p.m * p.h**2
    )


def plant(name, unit, x0, parameters, mass, build, fields, nominal):
    """Return a plant of one channel."""
    about = {"mass": mass, "unit": unit, "x0": (x0,)}
    return Plant(
        name=name, parameters=parameters, build=build, fields=fields, nominal=nominal, **about
    )


numbers = {"M": even_ratio(0.3, 3.0), "k": even(0.0, 10.0), "b": even(0.0, 1.0)}
drawn_slide = plant(
    "drawn_slide", "m", even(0.1, 0.5), numbers, "M", slide, slide_fields, slide_nominal
)
while True:
    stands = bool(rng.integers(2))
    numbers = {"m": even_ratio(0.2, 1.5), "h": even_ratio(0.25, 0.9), "b": even(0.0, 0.1)}
    start = even(0.2, 0.8)
    if numbers["m"] * GRAVITY * numbers["h"] <= HELD:
        break
numbers["h"] = height = numbers["h"] if stands else -numbers["h"]
drawn_pendulum = plant(
    "drawn_pendulum", "rad", start, numbers, "m", hinge, hinge_fields, hinge_nominal
)
