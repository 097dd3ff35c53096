"""Models with parts, and what the tests of mechanisms ask of a compiled model."""

import mujoco

from smc_mujoco.mechanisms.plant import write_fields

SORTS = {
    "geom": "ngeom",
    "body": "nbody",
    "joint": "njnt",
    "pair": "npair",
    "site": "nsite",
    "tendon": "ntendon",
    "actuator": "nu",
}


def unnamed(model) -> list[tuple[str, int]]:
    """(sort, id) of what has no name in a model."""
    things = []
    for sort, count in SORTS.items():
        for i in range(getattr(model, count)):
            things.append((sort, i))
    return [(sort, i) for sort, i in things if not getattr(model, sort)(i).name]


def build(p, *parts, h=2.5e-4, integrator=mujoco.mjtIntegrator.mjINT_IMPLICITFAST):
    """The plant's model with the parts in it."""
    spec = p.spec()
    for part in parts:
        part.edit(spec)
    model = spec.compile()
    model.opt.timestep, model.opt.integrator = h, integrator
    for part in parts:
        write_fields(model, part.fields(model))
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model
