"""Contacts of a cart on a rail: end stops, a post on the rail, a rough bed under its block.

The cart has rubber buffers at its ends, above the two rails, so that blows act along x. On the bed
it has no wheels: its block lies on a lining, pressed down by its weight through the joint `lift`,
and slides with Coulomb friction.
"""

import mujoco

from smc_mujoco.mechanisms.hardware.contact import (
    SOFT_IMPEDANCE,
    SOLREF_RUB,
    bar,
    box,
    hit,
    rub,
    solid,
)

STOP_RESTITUTION = 0.5  # of rubber buffers: chosen
BED_FRICTION = (
    0.1  # of the block on its bed: chosen, 1 N beside springs of 1 to 3 N and commands of 6 N
)
GRAVITY = 9.81  # m/s^2

RAIL_Z = 0.26  # m, height of the rails and of the cart
RAIL_Y = {"front": -0.10, "back": 0.10}  # m
HALF_BLOCK = 0.20  # m
BOTTOM_Z, MIDDLE_Z = 0.292, 0.342  # m, of the block
BUFFER_RADIUS = 0.030  # m
STOP_DEPTH = 1.0  # m, depth of a stop behind its face, enough for a blow of 100 m/s
FACE_X = HALF_BLOCK + BUFFER_RADIUS  # m, from the cart's middle to the face of its buffers
POST_RADIUS = 0.020  # m
# m, of the block's corners at rest
SINK_DEPTH = (1 - SOFT_IMPEDANCE) * GRAVITY * SOLREF_RUB[0] ** 2 / 4


def stops(spec: mujoco.MjSpec, x: float) -> None:
    """Add end stops that the cart hits when its middle is at -x or x, m."""
    machine = spec.body("machine")
    for side, sign in (("left", -1), ("right", 1)):
        buffers(spec, side, sign)
        face = x + FACE_X
        for rail, y in RAIL_Y.items():
            name = f"{side}_{rail}"
            beyond = sign * (face + 0.02)
            near, far = sorted((sign * face, beyond))
            box(machine, f"{name}_pad", (near, y - 0.036, 0.300), (far, y + 0.036, 0.384), "ink")
            near, far = sorted((sign * (face + 0.02), sign * (face + 0.10)))
            box(
                machine,
                f"{name}_stop",
                (near, y - 0.042, 0.224),
                (far, y + 0.042, 0.390),
                "graphite",
            )
            near, far = sorted((sign * face, sign * (face + STOP_DEPTH)))
            solid(machine, f"{name}_solid", (near, y - 0.036, 0.300), (far, y + 0.036, 0.384))
            hit(spec, (f"{name}_solid", f"{name}_buffer"), STOP_RESTITUTION)


def peg(spec: mujoco.MjSpec, x: float) -> None:
    """Add a post on the front rail that the cart, coming from the right, hits when its middle is at
    x, m.
    """
    machine = spec.body("machine")
    place = x - FACE_X - POST_RADIUS
    y = RAIL_Y["front"]
    buffers(spec, "left", -1)
    box(
        machine,
        "peg_clamp",
        (place - 0.045, y - 0.042, 0.224),
        (place + 0.020, y + 0.042, 0.300),
        "graphite",
    )
    bar(machine, "peg", ((place, y, 0.29), (place, y, 0.43)), POST_RADIUS, "brass", round_ends=True)
    hit(spec, ("peg", "left_front_buffer"), STOP_RESTITUTION)


def buffers(spec: mujoco.MjSpec, side: str, sign: int) -> None:
    """Add two rubber buffers at one end of the cart."""
    cart = spec.body("cart")
    for rail, y in RAIL_Y.items():
        buffer = cart.add_geom(
            name=f"{side}_{rail}_buffer", type=mujoco.mjtGeom.mjGEOM_SPHERE, material="ink"
        )
        buffer.pos = (sign * HALF_BLOCK, y, MIDDLE_Z - RAIL_Z)
        buffer.size = (BUFFER_RADIUS, 0, 0)


def bed(spec: mujoco.MjSpec, length: float) -> None:
    """Replace the rails by a rough bed from -length to length, m, on which the block lies."""
    for geom in list(spec.geoms):
        if geom.name.startswith("bearing") or geom.name in ("front_rail", "back_rail", "bed"):
            spec.delete(geom)
    machine = spec.body("machine")
    cart = spec.body("cart")
    box(machine, "bed", (-length, -0.150, 0.225), (length, 0.150, BOTTOM_Z - 0.012), "graphite")
    box(
        machine,
        "lining",
        (-length, -0.150, BOTTOM_Z - 0.012),
        (length, 0.150, BOTTOM_Z + SINK_DEPTH),
        "ink",
    )
    cart.add_joint(
        name="lift", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0, 0, 1), stiffness=0, damping=0
    )
    for key in spec.keys:
        key.qpos = [*key.qpos, 0.0]
    spec.option.gravity = (0.0, 0.0, -GRAVITY)
    rub(spec, ("lining", "block"), BED_FRICTION)
