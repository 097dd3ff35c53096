"""A chain of pendulums by other means: in one row, where their bobs collide, and with real springs between their rods.

In the row the pivots stand side by side in the plane of motion instead of along the shaft: bobs that hang touch nearly,
as in Newton's cradle. The coupling's torsion springs act all the same, their torques carried from pivot to pivot.

A real spring joins two rods at `HOOK` from their pivots: k = kc / HOOK^2, of no rest length where the pivots are one
behind the other, when its torque is kc sin(x_j - x_i), and of the pitch as rest length where they are side by side.
"""

import itertools

from smc_mujoco.mechanisms.geometry import coil
from smc_mujoco.mechanisms.geometry.pendulum_chain import DRAWN, HEIGHT, pendulum_fields, size
from smc_mujoco.mechanisms.hardware.contact import bar, box, hit
from smc_mujoco.mechanisms.plant import Field

ROW = 0.16  # m between pivots: bobs of 0.13 m that hang leave a gap of 0.03 m, chosen
CLACK = 0.95  # restitution of steel balls, chosen: 0.9 to 0.97 in Newton's cradles
HOOK = 0.25  # m from pivot to spring: chosen, half a rod
BEAM = (0.085, 0.125)  # m, where the beam that carries the pivots lies, behind the bobs


def bobs(spec):
    """Put the pivots side by side and let neighbouring bobs hit each other."""
    n, side = len(spec.keys[0].qpos), _side(spec)
    width = (n - 1) * ROW
    for i in range(n):
        spec.body(f"p{i}/pendulum").frame.pos = (i * ROW - width / 2, 0.0, HEIGHT)
    for geom in [g for g in spec.body("machine").geoms if not g.name.startswith("p")]:
        spec.delete(geom)
    _stand(spec, n, width)
    hooked = bool(spec.sites)
    for skin in list(spec.skins):
        spec.delete(skin)
    for i in range(n - 1):
        for pair in itertools.product((f"p{i}/bob", f"p{i}/rod"), (f"p{i + 1}/bob", f"p{i + 1}/rod")):
            hit(spec, pair, CLACK, both_move=True)  # beyond 54 degrees bobs pass each other, and meet rods
        if n <= DRAWN:
            _draw(spec, i, _pivot(spec, i), _pivot(spec, i + 1), side * (HOOK if hooked else 0.10))


def springs(spec):
    """Replace the torsion springs by real springs between the rods."""
    n, side = len(spec.keys[0].qpos), _side(spec)
    for item in [*spec.tendons, *spec.skins]:
        spec.delete(item)
    for i in range(n):
        body = spec.body(f"p{i}/pendulum")
        body.add_site(name=f"p{i}/hook", pos=(0.0, 0.0, side * HOOK), group=5, rgba=(0, 0, 0, 0))
    for i in range(n - 1):
        spring = spec.add_tendon(name=f"coupling{i}", springlength=(0.0, 0.0), group=5, rgba=(0, 0, 0, 0))
        spring.wrap_site(f"p{i}/hook")
        spring.wrap_site(f"p{i + 1}/hook")
        if n <= DRAWN:
            _draw(spec, i, _pivot(spec, i), _pivot(spec, i + 1), side * HOOK)


def spring_fields(model, p, side):
    """Yield the fields that p sets where the springs are real ones."""
    couplings = [model.tendon(f"coupling{i}").id for i in range(size(model) - 1)]
    pitch = model.body("p1/pendulum").pos[0] - model.body("p0/pendulum").pos[0]
    yield from pendulum_fields(model, p, side)
    yield Field("tendon_stiffness", couplings, p.kc / HOOK**2)
    yield Field("tendon_lengthspring", couplings, pitch)


def _side(spec):
    """Return +1 where the bobs stand above their pivots, -1 where they hang."""
    return 1.0 if spec.geom("p0/bob").pos[2] > 0.0 else -1.0


def _pivot(spec, i):
    return tuple(spec.body(f"p{i}/pendulum").frame.pos)


def _draw(spec, i, near, far, up):
    """Draw the spring between rods i and i + 1, `up` metres above their pivots."""
    start, end = ((x, y, z + up) for x, y, z in (near, far))
    coil.draw(
        spec,
        f"spring{i}",
        start=(f"p{i}/pendulum", near, start),
        end=(f"p{i + 1}/pendulum", far, end),
        radius=0.020,
        turns=9,
        wire=0.0045,
        material="brass",
    )


def _stand(spec, n, width):
    """Add a beam behind the row between two posts, and a camera that looks at the row from the front."""
    machine, end = spec.body("machine"), width / 2 + 0.20
    box(machine, "beam", (-end, BEAM[0], HEIGHT - 0.030), (end, BEAM[1], HEIGHT + 0.030), "graphite")
    for i in range(n):
        x = i * ROW - width / 2
        bar(machine, f"axle{i}", ((x, -0.03, HEIGHT), (x, BEAM[0], HEIGHT)), 0.010, "steel")
    for side, x in (("left", -end), ("right", end)):
        y = sum(BEAM) / 2
        bar(machine, f"{side}_foot", ((x, y, 0), (x, y, 0.028)), 0.15, "graphite")
        bar(machine, f"{side}_step", ((x, y, 0.028), (x, y, 0.040)), 0.055, "steel")
        bar(machine, f"{side}_post", ((x, y, 0.028), (x, y, HEIGHT + 0.045)), 0.024, "graphite")
    shown = min(width, 8 * ROW)  # as the chain's camera, nine pendulums at most
    spec.stat.center, spec.stat.extent = (0.0, 0.0, HEIGHT), 1.6 + shown
    away = 2.2 + 0.9 * shown
    camera = spec.camera("look")
    camera.pos = (-0.245 * away, -0.953 * away, HEIGHT - 0.05 + 0.176 * away)
    camera.alt.xyaxes = (0.969, -0.248, 0.0, 0.046, 0.181, 0.982)
