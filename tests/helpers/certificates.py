"""Certificates whose numbers nobody proved."""

import smc_mujoco as smc
from smc_mujoco.evidence.certificates.certificate import Certificate

LEVELS = {
    "x": [0.0, 1.0, 2.0],
    "s": [-2.0, 0.0, 2.0],
    "W": [[0.5, 0.0, 0.5], [0.75, 0.25, 0.5], [1.0, 1.0, 1.0]],
    "start": [0.5, 0.0],
    "inner": 0.1,
    "outer": 0.6,
    "bound": 0.3,
}


def part(theorem, margins, **data):
    """Return a theorem's data; `margins`: condition -> margin."""
    conditions = []
    for name, margin in margins.items():
        conditions.append({"name": name, "margin": margin})
    return {
        "theorem": theorem,
        "holds": min(margins.values()) >= 0.0,
        "conditions": conditions,
    } | data


PARTS = [
    part(
        "saturated PD",
        {"damping": -0.25, "restoring": 0.125, "local": 3.0},
    ),
    part("level sets", {"actuator": 1.5, "start": 0.2}, **LEVELS),
]


def certificate(plant="duffing", law="observer_free", gains=None, parts=PARTS, **changes):
    """Return a certificate of a plant's equation and a law."""
    its = smc.plant(plant)
    plain = {
        "format": "x",
        "u_max": 6.0,
        "unit": its.unit,
        "disturbance": 2.0,
        "plant": {
            "name": plant,
            "n": its.n,
            "parameters": dict(its.parameters),
            "mechanism": "equation",
        },
        "law": {"name": law, "gains": gains or {"lam": 6.0, "k1": 3.0}},
        "parts": parts,
        "seal": "y",
    }
    return Certificate(data=plain | changes)
