"""Measurement noise of the fast engine.

On the processor the noise of AHEAD readings is drawn at once. The sine and the cosine of a random
angle take branches that the processor cannot predict, and each wrong guess throws away its work on
the steps that follow. So angles that take the same branches come one after another.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import functools
import math
from typing import Any

from smc_mujoco.analysis.engine.form import SETTING, Form, layout
from smc_mujoco.common import fingerprint
from smc_mujoco.common.jit import (
    SIGNATURE,
    Key,
    address_of,
    call,
    compiled_cfunc,
    inlined,
    integers,
    pointer,
)
from smc_mujoco.simulation import philox

AHEAD = 64  # readings, chosen
EIGHTHS = 8  # of a turn: within one, sin and cos take the same branches for nearly all angles
# Of the state, whole numbers: where the list of each eighth ends, and the lists.
LISTS = EIGHTHS * (1 + AHEAD)
# Of the state, for each channel: the seed of its noise, 1 + the first reading, and the noise.
KEPT = 2 + 2 * AHEAD


@inlined
def drawn(view, i, j):
    """Return the noise of reading j of channel i, of position and velocity."""
    return philox.normals(view.row[SETTING.seed], i, philox.MEASUREMENT, j)


def drawn_size(form: Form) -> int:
    """Return how many numbers of the state `drawn_ahead` takes."""
    return LISTS + KEPT * form.n if form.noise else 0


def drawn_ahead(form: Form) -> Any:
    """Return a function that gives the same numbers as `drawn`, AHEAD of which are drawn at once.

    They are in the state of a run, behind all that the layout names.
    """
    first_place = layout(form).work_size
    address = layout(form).row.draw

    @inlined
    def noise(view, i, j):
        row, _, work = view
        list_at = first_place + LISTS + KEPT * i
        seed = row[SETTING.seed]
        first = j - j % AHEAD
        if work[list_at + 1] != first + 1.0 or work[list_at] != seed:
            call(int(row[address]), int(seed), i, first, address_of(work) + 8 * first_place)
            work[list_at] = seed
            work[list_at + 1] = first + 1.0
        pair = list_at + 2 + 2 * (j - first)
        return work[pair], work[pair + 1]

    return noise


@functools.cache
def drawing() -> Any:
    """Return `_draw` as a C function; it is compiled once for all forms."""
    return compiled_cfunc(SIGNATURE, _draw, Key(__name__, fingerprint.now(_draw)))


def _draw(seed, channel, first, state):
    """Write the noise of AHEAD readings, from the first on, into the state."""
    ends = integers(state)
    lists = integers(state + 8 * EIGHTHS)
    pairs = pointer(state + 8 * (LISTS + KEPT * channel + 2))
    for eighth in range(EIGHTHS):
        ends[eighth] = eighth * AHEAD
    for m in range(AHEAD):
        radius, angle = philox.polar(seed, channel, philox.MEASUREMENT, first + m)
        pairs[2 * m] = radius
        pairs[2 * m + 1] = angle
        eighth = int(angle * (4.0 / math.pi))
        lists[ends[eighth]] = m
        ends[eighth] += 1
    for eighth in range(EIGHTHS):
        for entry in range(eighth * AHEAD, ends[eighth]):
            m = lists[entry]
            pairs[2 * m], pairs[2 * m + 1] = philox.cartesian(pairs[2 * m], pairs[2 * m + 1])
    return 0
