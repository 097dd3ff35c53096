"""Joints with friction, for benchmarks/friction.py: M x'' = -G sin(x + off) - D x' + u + d.

`rail` is a mass on a slide. `geared` is a link that its motor holds at 0.8 rad against gravity,
with 29 % of the bound on u. `ak80` is the AK80-6 pendulum, upright, with the friction that was
found in its public records, see `smc_mujoco.evidence.rigs`. `drawn` makes a rail and a link by
chance.
"""

import dataclasses
import math
from functools import partial

import mujoco
import numpy as np

from smc_mujoco.evidence.rigs.machines.simple_pendulum_ak80 import SIMPLE_PENDULUM
from smc_mujoco.hardware import LuGre, ServoFriction, Stribeck
from smc_mujoco.mechanisms.hardware.part import Friction
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
COUNTS = 4096  # of the encoder: per revolution of a hinge, over the start of a slide
STRIBECK = 0.02  # of the start over the time scale: the speed at which friction has fallen


@dataclasses.dataclass(frozen=True)
class Joint:
    """A joint, its bound on u, where runs start, and its frictions as shares of the bound."""

    plant: Plant
    bound: float  # N m (N)
    start: float  # rad (m)
    levels: dict[str, tuple[float, float]]  # name -> dry friction in motion and at rest
    others: tuple[str, ...] = ()  # frictions that MuJoCo alone runs, under gains chosen without
    printed: bool = True  # whether the page prints its points, so that MuJoCo runs them

    @property
    def scale(self) -> float:
        """The time in which the bound moves the joint by the start, s."""
        return math.sqrt(self.start * self.plant.parameters["M"] / self.bound)

    @property
    def counts(self) -> int:
        """Counts of the encoder, per revolution or metre."""
        return COUNTS if self.plant.unit == "rad" else round(COUNTS / self.start)

    @property
    def count(self) -> float:
        """One of them, rad (m)."""
        return (math.tau if self.plant.unit == "rad" else 1.0) / self.counts

    @property
    def slow(self) -> float:
        """The speed of Stribeck's drop, rad/s (m/s)."""
        return STRIBECK * self.start / self.scale

    def friction(self, name: str) -> Friction:
        """Return a friction by its name; "none" is one of level 0, which the same loop runs."""
        if name == "lugre":  # bristles bend by a thousandth of the start
            level = 0.1 * self.bound
            return LuGre(level, 1.5 * level, self.slow, stiffness=1e3 * level / self.start)
        if name == "load":
            return ServoFriction(
                kv=0.0,
                kc=0.03 * self.bound,
                kcs=0.012 * self.bound,
                km=0.12,
                ke=0.12,
                kms=0.048,
                kes=0.048,
                vs=self.slow,
                alpha=2.0,
            )
        moving, resting = self.levels.get(name, (0.0, 0.0))
        return Stribeck(moving * self.bound, resting * self.bound, self.slow)


def build(kind: str, off: float, n: int) -> mujoco.MjSpec:
    """Return the mechanism: a slide, or a link that hangs at x = -off."""
    del n
    numbers = {"axis": "1 0 0", "x": 0.0, "z": 0.0}
    if kind == "hinge":
        numbers = {"axis": "0 1 0", "x": -ARM * math.sin(off), "z": -ARM * math.cos(off)}
    return mujoco.MjSpec.from_string(MODEL.format(kind=kind, **numbers))


def slide_fields(model, p):
    yield Field("body_mass", 1, p.M)
    yield Field("dof_damping", 0, p.D)


def hinge_fields(model, p):
    yield Field("body_mass", 1, p.G / (GRAVITY * ARM))
    yield Field("dof_armature", 0, p.M - p.G * ARM / GRAVITY)
    yield Field("dof_damping", 0, p.D)


def nominal(x, v, i, p):
    return (-p.G * math.sin(x[i] + p.off) - p.D * v[i]) / p.M, 1.0 / p.M


def joint(name, kind, parameters, bound, start, levels, **more):
    """Return a joint of a slide or a hinge."""
    fields = slide_fields if kind == "slide" else hinge_fields
    plant = Plant(
        name=name,
        parameters=parameters,
        mass="M",
        unit="m" if kind == "slide" else "rad",
        x0=(start,),
        build=partial(build, kind, parameters["off"]),
        fields=fields,
        nominal=nominal,
    )
    return Joint(plant, bound, start, levels, **more)


LEVELS = {"coulomb10": (0.1, 0.1), "coulomb30": (0.3, 0.3), "stribeck": (0.15, 0.225)}
OTHERS = ("load", "lugre", "play, motor", "play, link", "contact")  # play: with the friction's side
RAIL = {"M": 1.0, "D": 0.0, "G": 0.0, "off": 0.0}
LINK = {"M": 0.225, "D": 0.02, "G": 2.4525, "off": 0.8}


def machine() -> Joint:
    """Return the AK80-6 pendulum, upright; half of its torque is the bound, as in its searches."""
    found = {name: one.value for name, one in SIMPLE_PENDULUM.quantities.items()}
    moment = found["mass_moment"] * GRAVITY
    numbers = {"M": found["inertia"], "D": found["viscous"], "G": moment, "off": math.pi}
    bound = found["torque_limit"] / 2
    level = found["coulomb"] / bound
    return joint("ak80", "hinge", numbers, bound, 0.3, {"identified": (level, level)})


def drawn(seed: int) -> dict[str, Joint]:
    """Return a rail and a link drawn by chance, with levels from half to one and a half times."""
    rng = np.random.default_rng(seed)

    def between(low: float, high: float) -> float:
        return float(f"{math.exp(rng.uniform(math.log(low), math.log(high))):.3g}")

    found = {}
    for name, kind, usual in (("drawn_rail", "slide", RAIL), ("drawn_geared", "hinge", LINK)):
        numbers = dict(usual)
        numbers["M"] *= between(0.4, 2.5)
        bound = 6.0 * between(0.6, 1.5)
        if kind == "hinge":
            numbers["G"] *= between(0.5, 1.5)
            numbers["off"] = between(0.3, 1.2)
        factor = between(0.5, 1.5)
        levels = {what: (factor * a, factor * b) for what, (a, b) in LEVELS.items()}
        start = (0.1 if kind == "slide" else 0.5) * between(0.5, 1.5)
        found[name] = joint(name, kind, numbers, bound, start, levels, printed=False)
    return found


def joints(seed: int | None = None) -> dict[str, Joint]:
    """Return the joints of the page, or those drawn with a seed."""
    if seed is not None:
        return drawn(seed)
    return {
        "rail": joint("rail", "slide", RAIL, 6.0, 0.1, LEVELS, others=OTHERS),
        "geared": joint("geared", "hinge", LINK, 6.0, 0.5, LEVELS, others=OTHERS[:2]),
        "ak80": machine(),
    }
