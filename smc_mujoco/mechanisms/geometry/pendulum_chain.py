"""A chain of pendulums on one shaft: one body attached n times, neighbours joined by torsion
springs.

Channel i is the joint p<i>/hinge, the actuator p<i>/u and the sensors p<i>/x, p<i>/v. The springs
are fixed tendons of length x[i+1] - x[i] and stiffness kc: exact, and linear in n. The ends are
free; the shaft that carries the pendulums transmits nothing.

Contact `bobs` puts the pivots side by side in the plane of motion: hanging bobs nearly touch, as in
Newton's cradle. The torsion springs still act, with torques carried from pivot to pivot.

Mechanism `springs` joins neighbouring rods by a real spring at a = `HOOK_ARM` from their pivots: k
= kc / a^2. If the pivots are one behind the other, its rest length is 0 and its torque kc sin(x_j -
x_i). If they are side by side, its rest length is the pitch.
"""

import itertools

from smc_mujoco.mechanisms.geometry import coil
from smc_mujoco.mechanisms.hardware.contact import bar, box, hit
from smc_mujoco.mechanisms.plant import Field, geom_fields, model_spec

PITCH = 0.22  # m between neighbours: chosen, so that bobs of 0.13 m pass each other
HEIGHT = 0.8  # m, the shaft above the floor, as for the single pendulum
HUB = 0.02  # m, half the length of a hub, where a spring's wire ends
COUPLING = 0.5  # N m/rad: chosen for the paper study
MAX_DRAWN = 50  # pendulums whose springs are drawn, each of a thousand vertices
HOOK_ARM = 0.25  # m from pivot to real spring: chosen, half a rod

ROW_PITCH = 0.16  # m between pivots side by side: chosen, hanging bobs leave a gap of 0.03 m
BOB_RESTITUTION = 0.95  # of steel balls, chosen: 0.9 to 0.97 in Newton's cradles
BEAM_Y = (0.085, 0.125)  # m, y of the beam behind the bobs that carries the pivots side by side


def compose(single, n, x0):
    """Return the MjSpec of n pendulums taken from the model file `single`, at x0 (repeated) in
    keyframe `home`.
    """
    source = model_spec(single)
    spec = model_spec("common/theme.xml")
    spec.modelname = f"{n}_{source.modelname}s"
    spec.compiler.degree = source.compiler.degree
    spec.copy_during_attach = True
    spec.option = source.option
    machine = stand(spec, n)

    pendulum = source.body("pendulum")
    pendulum.pos = (0.0, 0.0, 0.0)
    material = strip(source, pendulum)
    for i in range(n):
        frame = machine.add_frame(pos=(0.0, i * PITCH, HEIGHT))
        copy = frame.attach_body(pendulum, f"p{i}/", "")
        for geom in copy.geoms:
            geom.material = material[geom.name.removeprefix(f"p{i}/")]
    start = [x0[i % len(x0)] for i in range(n)]
    spec.add_key(name="home", qpos=start)
    for i in range(n - 1):
        spring = spec.add_tendon(name=f"coupling{i}", stiffness=COUPLING, springlength=(0.0, 0.0))
        spring.wrap_joint(f"p{i}/hinge", -1.0)
        spring.wrap_joint(f"p{i + 1}/hinge", 1.0)
        near = pivot(spec, i)
        far = pivot(spec, i + 1)
        draw_spring(
            spec,
            i,
            (0.0, near[1] + HUB, HEIGHT),
            (0.0, far[1] - HUB, HEIGHT),
            radius=0.022,
            turns=8,
        )
    return spec


def strip(source, pendulum):
    """Delete everything but the pendulum from `source`, and return geom name -> the material it
    had.

    An attached body brings its file's assets and keyframes, so a thousand copies would bring a
    thousand floors.
    """
    material = {geom.name: geom.material for geom in pendulum.geoms}
    for geom in pendulum.geoms:
        geom.material = ""
    scenery = [geom for geom in source.geoms if geom.name not in material]
    for item in [
        *scenery,
        *source.cameras,
        *source.lights,
        *source.materials,
        *source.textures,
        *source.keys,
    ]:
        source.delete(item)
    return material


def stand(spec, n):
    """Add the body `machine`, two end posts and the shaft between them, and return it."""
    length = (n - 1) * PITCH
    in_view = min(length, 8 * PITCH)  # the camera frames nine pendulums at most
    spec.stat.center = (0.0, in_view / 2, HEIGHT)
    spec.stat.extent = 1.2 + in_view
    spec.stat.meansize = 0.1
    distance = 1.6 + 0.9 * in_view
    machine = spec.worldbody.add_body(name="machine")
    machine.add_camera(
        name="look",
        pos=(0.62 * distance, in_view / 2 - 0.74 * distance, 0.62 + 0.26 * distance),
        xyaxes=(0.767, 0.642, 0.0, -0.167, 0.199, 0.966),
    )
    bar(machine, "shaft", ((0.0, -PITCH, HEIGHT), (0.0, length + PITCH, HEIGHT)), 0.008, "steel")
    for end, y in (("front", -PITCH), ("back", length + PITCH)):
        post(machine, end, 0.0, y, HEIGHT)
        bar(
            machine,
            f"{end}_bearing",
            ((0.0, y - 0.03, HEIGHT), (0.0, y + 0.03, HEIGHT)),
            0.042,
            "steel",
        )
    return machine


def post(machine, name, x, y, top):
    """Add a post on a foot at (x, y), up to `top`, m."""
    bar(machine, f"{name}_foot", ((x, y, 0.0), (x, y, 0.028)), 0.15, "graphite")
    bar(machine, f"{name}_step", ((x, y, 0.028), (x, y, 0.040)), 0.055, "steel")
    bar(machine, f"{name}_post", ((x, y, 0.028), (x, y, top)), 0.024, "graphite")


def pivot(spec, i):
    """Return the position of pendulum i's pivot, m."""
    return tuple(spec.body(f"p{i}/pendulum").frame.pos)


def draw_spring(spec, i, start, end, radius, turns):
    """Draw the spring between pendulums i and i + 1, from `start` to `end` in m, unless there are
    too many.
    """
    if len(spec.keys[0].qpos) > MAX_DRAWN:
        return
    near = (f"p{i}/pendulum", pivot(spec, i), start)
    far = (f"p{i + 1}/pendulum", pivot(spec, i + 1), end)
    coil.add_coil(
        spec, f"spring{i}", near, far, radius=radius, turns=turns, wire=0.0045, material="brass"
    )


def fields(model, p):
    """Yield the fields that p sets if torsion springs join the pendulums."""
    springs = _couplings(model)
    yield from pendulum_fields(model, p)
    yield Field("tendon_stiffness", springs, p.kc)


def pendulum_fields(model, p):
    """Yield the fields of the pendulums alone, without the springs between them."""
    n = pendulum_count(model)
    side = above(model.body("p0/pendulum").ipos)
    bodies = [model.body(f"p{i}/pendulum").id for i in range(n)]
    yield Field("body_mass", bodies, p.m)
    yield Field("body_ipos", bodies, (0.0, 0.0, side * p.l))
    yield Field("dof_damping", model.body_dofadr[bodies], p.b)
    yield Field("opt.gravity", 2, -p.grav)
    for i in range(n):
        half = side * p.l / 2
        yield from geom_fields(model, f"p{i}/rod", (0.0, 0.0, half), (1, p.l / 2))
        yield from geom_fields(model, f"p{i}/bob", (0.0, 0.0, side * p.l))


def _couplings(model):
    """Return the ids of the springs between neighbours."""
    return [model.tendon(f"coupling{i}").id for i in range(pendulum_count(model) - 1)]


def pendulum_count(model):
    """Return the number of pendulums in a chain's model. It counts bodies, because a Backlash adds
    joints.
    """
    return sum(model.body(i).name.endswith("/pendulum") for i in range(model.nbody))


def above(bob):
    """Return 1 if a bob, at a place in its body's frame, stands above its pivot, -1 if it hangs."""
    return 1.0 if bob[2] > 0.0 else -1.0


def bobs(spec):
    """Put the pivots side by side and let neighbouring bobs hit each other."""
    n = len(spec.keys[0].qpos)
    side = above(spec.geom("p0/bob").pos)
    width = (n - 1) * ROW_PITCH
    for i in range(n):
        place = (i * ROW_PITCH - width / 2, 0.0, HEIGHT)
        spec.body(f"p{i}/pendulum").frame.pos = place
    for geom in list(spec.body("machine").geoms):
        if not geom.name.startswith("p"):
            spec.delete(geom)
    stand_row(spec, n, width)
    hooked = bool(spec.sites)
    for skin in list(spec.skins):
        spec.delete(skin)
    for i in range(n - 1):
        own = f"p{i}/bob", f"p{i}/rod"
        next_one = f"p{i + 1}/bob", f"p{i + 1}/rod"
        # beyond 54 degrees bobs pass each other, and meet rods
        for pair in itertools.product(own, next_one):
            hit(spec, pair, BOB_RESTITUTION, both_move=True)
        draw_between_rods(spec, i, side * (HOOK_ARM if hooked else 0.10))


def springs(spec):
    """Replace the torsion springs by real springs between the rods."""
    n = len(spec.keys[0].qpos)
    side = above(spec.geom("p0/bob").pos)
    for item in [*spec.tendons, *spec.skins]:
        spec.delete(item)
    for i in range(n):
        body = spec.body(f"p{i}/pendulum")
        body.add_site(name=f"p{i}/hook", pos=(0.0, 0.0, side * HOOK_ARM))
    for i in range(n - 1):
        spring = spec.add_tendon(
            name=f"coupling{i}", springlength=(0.0, 0.0), group=5, rgba=(0, 0, 0, 0)
        )
        spring.wrap_site(f"p{i}/hook")
        spring.wrap_site(f"p{i + 1}/hook")
        draw_between_rods(spec, i, side * HOOK_ARM)


def spring_fields(model, p):
    """Yield the fields that p sets if real springs join the pendulums."""
    couplings = _couplings(model)
    first = model.body("p0/pendulum").pos[0]
    pitch = model.body("p1/pendulum").pos[0] - first
    yield from pendulum_fields(model, p)
    yield Field("tendon_stiffness", couplings, p.kc / HOOK_ARM**2)
    yield Field("tendon_lengthspring", couplings, pitch)


def draw_between_rods(spec, i, up):
    """Draw the spring between rods i and i + 1, `up` metres above their pivots."""
    x, y, z = pivot(spec, i)
    start = (x, y, z + up)
    x, y, z = pivot(spec, i + 1)
    end = (x, y, z + up)
    draw_spring(spec, i, start, end, radius=0.020, turns=9)


def stand_row(spec, n, width):
    """Add a beam behind the row between two posts, and a camera that looks at the row from the
    front.
    """
    machine = spec.body("machine")
    end = width / 2 + 0.20
    box(
        machine,
        "beam",
        (-end, BEAM_Y[0], HEIGHT - 0.030),
        (end, BEAM_Y[1], HEIGHT + 0.030),
        "graphite",
    )
    for i in range(n):
        x = i * ROW_PITCH - width / 2
        bar(machine, f"axle{i}", ((x, -0.03, HEIGHT), (x, BEAM_Y[0], HEIGHT)), 0.010, "steel")
    for side, x in (("left", -end), ("right", end)):
        post(machine, side, x, sum(BEAM_Y) / 2, HEIGHT + 0.045)
    in_view = min(width, 8 * ROW_PITCH)  # as the chain's camera, nine pendulums at most
    spec.stat.center = (0.0, 0.0, HEIGHT)
    spec.stat.extent = 1.6 + in_view
    distance = 2.2 + 0.9 * in_view
    camera = spec.camera("look")
    raised = HEIGHT - 0.05 + 0.176 * distance
    camera.pos = (-0.245 * distance, -0.953 * distance, raised)
    camera.alt.xyaxes = (0.969, -0.248, 0.0, 0.046, 0.181, 0.982)
