"""Drawings of springs: a helix of wire whose ends follow two bodies. No mass, no force."""

import numpy as np

SIDES = 6  # of a cross-section
STEPS_PER_TURN = 12  # of the wire


def add_coil(spec, name, start, end, *, radius, turns, wire, material):
    """Add a coil spring of whole turns to spec, as the skin `name`; radii of coil and wire in m.

    start, end: (body, position of the body, position of the wire's end), metres in the world with
    every joint at 0. A point at s in [0, 1] between them follows the bodies with weights 1 - s and
    s, so the coil stretches evenly.
    """
    first = np.array(start[2], float)
    last = np.array(end[2], float)
    axis = (last - first) / np.linalg.norm(last - first)
    up = np.array([0.0, 0.0, 1.0])
    s = np.linspace(0.0, 1.0, turns * STEPS_PER_TURN + 1)
    turn = 2 * np.pi * turns * s[:, None]
    sideways = np.cross(axis, up)
    outward = np.cos(turn) * up + np.sin(turn) * sideways
    steps = np.arange(SIDES)[:, None]
    around = 2 * np.pi * steps / SIDES
    line = first + s[:, None] * (last - first)
    centre = line + radius * outward
    outwards = np.cos(around) * outward[:, None]
    vertices = centre[:, None] + wire * (outwards + np.sin(around) * axis)
    _skin(spec, name, start, end, material, vertices, s)


def _skin(spec, name, start, end, material, vertices, s):
    """Add a skin of rings of vertices (rings, SIDES, 3) that follow the bodies with weights 1 - s
    and s, (rings,).
    """
    turns = np.arange(len(s) - 1)[:, None]
    ring = turns * SIDES
    a = ring + np.arange(SIDES)
    b = ring + (np.arange(SIDES) + 1) % SIDES
    faces = np.stack([a, b, a + SIDES, b, b + SIDES, a + SIDES], axis=-1)

    skin = spec.add_skin(name=name, material=material)
    skin.vert = vertices.ravel()
    skin.face = faces.ravel()
    skin.bodyname = [start[0], end[0]]
    skin.bindpos = [*start[1], *end[1]]
    skin.bindquat = [1.0, 0.0, 0.0, 0.0] * 2
    follow = np.repeat(s, SIDES)
    skin.vertid = [list(range(len(follow)))] * 2
    skin.vertweight = [list(1.0 - follow), list(follow)]
