"""A chain of pendulums on one shaft: one body attached n times, neighbours joined by torsion springs.

Channel i is the joint p<i>/hinge, the actuator p<i>/u and the sensors p<i>/x, p<i>/v. The springs are fixed
tendons of length x[i+1] - x[i] and stiffness kc: exact, and linear in n. The ends are free; the shaft that
carries the pendulums transmits nothing.
"""

import mujoco

from smc_mujoco.mechanisms.geometry import coil
from smc_mujoco.mechanisms.plant import Field, model_path

PITCH = 0.22  # m between neighbours: chosen, so that bobs of 0.13 m pass freely
HEIGHT = 0.8  # m, the shaft above the floor: as the single pendulum's
HUB = 0.02  # m, half a hub: where a spring's wire ends
KC = 0.5  # N m/rad: chosen for the paper study
DRAWN = 50  # pendulums up to which springs are drawn: each has a thousand vertices to move a frame


def compose(single, n, x0):
    """Return the MjSpec of n pendulums taken from the model file `single`, at x0 (recycled) in keyframe `home`."""
    unit = mujoco.MjSpec.from_file(str(model_path(single)))
    spec = mujoco.MjSpec.from_file(str(model_path("common/theme.xml")))
    spec.modelname = f"{n}_{unit.modelname}s"
    spec.compiler.degree = unit.compiler.degree
    spec.copy_during_attach = True
    spec.option = unit.option
    machine = stand(spec, n)

    pendulum = unit.body("pendulum")
    pendulum.pos = (0.0, 0.0, 0.0)
    material = strip(unit, pendulum)
    for i in range(n):
        copy = machine.add_frame(pos=(0.0, i * PITCH, HEIGHT)).attach_body(pendulum, f"p{i}/", "")
        for geom in copy.geoms:
            geom.material = material[geom.name.removeprefix(f"p{i}/")]
    for i in range(n - 1):
        spring = spec.add_tendon(name=f"coupling{i}", stiffness=KC, springlength=(0.0, 0.0))
        spring.wrap_joint(f"p{i}/hinge", -1.0)
        spring.wrap_joint(f"p{i + 1}/hinge", 1.0)
        if n <= DRAWN:
            draw_spring(spec, i)
    spec.add_key(name="home", qpos=[x0[i % len(x0)] for i in range(n)])
    return spec


def strip(unit, pendulum):
    """Leave only the pendulum in `unit`, and return geom name -> the material it had.

    An attached body brings its file's assets and keyframes: a thousand copies would carry a thousand floors.
    """
    material = {geom.name: geom.material for geom in pendulum.geoms}
    for geom in pendulum.geoms:
        geom.material = ""
    scenery = [geom for geom in unit.geoms if geom.name not in material]
    for item in [*scenery, *unit.cameras, *unit.lights, *unit.materials, *unit.textures, *unit.keys]:
        unit.delete(item)
    return material


def stand(spec, n):
    """Add the body `machine`: two end posts and the shaft between them."""
    length = (n - 1) * PITCH
    shown = min(length, 8 * PITCH)  # the camera frames nine pendulums at most
    spec.stat.center = (0.0, shown / 2, HEIGHT)
    spec.stat.extent = 1.2 + shown
    spec.stat.meansize = 0.1
    away = 1.6 + 0.9 * shown
    machine = spec.worldbody.add_body(name="machine")
    machine.add_camera(
        name="look",
        pos=(0.62 * away, shown / 2 - 0.74 * away, 0.62 + 0.26 * away),
        xyaxes=(0.767, 0.642, 0.0, -0.167, 0.199, 0.966),
    )
    rods = {"shaft": ((0.0, -PITCH, HEIGHT), (0.0, length + PITCH, HEIGHT), 0.008, "steel")}
    for end, y in (("front", -PITCH), ("back", length + PITCH)):
        rods |= {
            f"{end}_foot": ((0.0, y, 0.0), (0.0, y, 0.028), 0.15, "graphite"),
            f"{end}_step": ((0.0, y, 0.028), (0.0, y, 0.040), 0.055, "steel"),
            f"{end}_post": ((0.0, y, 0.028), (0.0, y, HEIGHT), 0.024, "graphite"),
            f"{end}_bearing": ((0.0, y - 0.03, HEIGHT), (0.0, y + 0.03, HEIGHT), 0.042, "steel"),
        }
    for name, (bottom, top, radius, material) in rods.items():
        machine.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            fromto=(*bottom, *top),
            size=(radius, 0.0, 0.0),
            material=material,
        )
    return machine


def draw_spring(spec, i):
    """Draw the spring between pendulums i and i + 1: a coil round the shaft, wound by their difference."""
    near, far = (0.0, i * PITCH, HEIGHT), (0.0, (i + 1) * PITCH, HEIGHT)
    coil.draw(
        spec,
        f"spring{i}",
        start=(f"p{i}/pendulum", near, (0.0, near[1] + HUB, HEIGHT)),
        end=(f"p{i + 1}/pendulum", far, (0.0, far[1] - HUB, HEIGHT)),
        radius=0.022,
        turns=8,
        wire=0.0045,
        material="brass",
    )


def fields(model, p, side):
    """Yield the fields that p sets; side: +1 where the bobs stand above the shaft, -1 where they hang."""
    springs = [model.tendon(f"coupling{i}").id for i in range(size(model) - 1)]
    yield from pendulum_fields(model, p, side)
    yield Field("tendon_stiffness", springs, p.kc)


def pendulum_fields(model, p, side):
    """Yield the fields of the pendulums alone, without the springs between them."""
    n = size(model)
    bodies = [model.body(f"p{i}/pendulum").id for i in range(n)]
    rods = [model.geom(f"p{i}/rod").id for i in range(n)]
    bobs = [model.geom(f"p{i}/bob").id for i in range(n)]
    yield Field("body_mass", bodies, p.m)
    yield Field("body_ipos", bodies, (0.0, 0.0, side * p.l))
    yield Field("dof_damping", model.body_dofadr[bodies], p.b)
    yield Field("opt.gravity", 2, -p.grav)
    yield Field("geom_pos", rods, (0.0, 0.0, side * p.l / 2))
    yield Field("geom_size", (rods, 1), p.l / 2)
    yield Field("geom_pos", bobs, (0.0, 0.0, side * p.l))


def size(model):
    """Return how many pendulums a chain's model has; actuators may have added joints of their own."""
    return sum(model.body(i).name.endswith("/pendulum") for i in range(model.nbody))
