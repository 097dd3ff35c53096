"""MuJoCo's soft constraints on bodies that move alone: dry friction on each, and the flanks of a
play between two of them, a joint and its rotor.

In a step h, a constraint of the speed v exerts the force F that gives the acceleration a, which
has the share g of F, the distance

    (R + g) F = a_ref - a_0,   R = (1 - d)/d g       a_0: the acceleration without F
    a_ref = -v/(d h) - k p                           p: penetration; 0 for friction

with the impedance d and k = 1/(2 d h ratio)^2 d, as both time constants are 2 h. Dry friction has F
within its level, and a flank only presses. MuJoCo's solver searches for such forces and ends at a
tolerance; here they are exact. Parts set the impedance and the ratio: see HARD_SOLIMP and
STOP_SOLREF.
"""

import math
from typing import Any, NamedTuple

from smc_mujoco.common.jit import inlined
from smc_mujoco.mechanisms.hardware.backlash import STOP_SOLREF
from smc_mujoco.mechanisms.hardware.part import HARD_SOLIMP

IMPEDANCE = HARD_SOLIMP[0]
RATIO = STOP_SOLREF[1]


class Body(NamedTuple):
    """A joint or a rotor at the start of a step, without constraints."""

    v: Any
    a: Any
    mobility: Any  # acceleration per unit of force
    level: Any  # of its dry friction


@inlined
def dry_friction(body, pull, h):
    """Return the force of dry friction on a body on which a flank exerts the force `pull`."""
    a = body.a + body.mobility * pull
    holding = -(body.v / h + IMPEDANCE * a) / body.mobility
    return min(max(holding, -body.level), body.level)


@inlined
def _yields(body, way, h):
    """Return the pull at which friction is at its level, in the direction `way`."""
    return -(body.v / h + IMPEDANCE * body.a) / (IMPEDANCE * body.mobility) - (
        way * body.level / IMPEDANCE
    )


@inlined
def _lacks(joint, rotor, push, press, side, h):
    """Return by how much the flank's acceleration is beyond what it demands of the force `press`,
    which grows with it.
    """
    of_joint = -side * press
    of_rotor = side * press
    a = rotor.a + rotor.mobility * (of_rotor + dry_friction(rotor, of_rotor, h))
    a -= joint.a + joint.mobility * (of_joint + dry_friction(joint, of_joint, h))
    softness = (1.0 - IMPEDANCE) / IMPEDANCE * (joint.mobility + rotor.mobility)
    return side * a + softness * press - push


@inlined
def flank_force(joint, rotor, apart, half_gap, h):
    """Return the force of a play's flank on the rotor, which is `apart` from its joint. That on
    the joint has the other sign.
    """
    if abs(apart) <= half_gap:
        return 0.0
    side = -1.0 if apart > 0.0 else 1.0
    stiffness = 1.0 / (IMPEDANCE * (2.0 * RATIO * h) ** 2)
    push = (abs(apart) - half_gap) * stiffness
    push -= side * (rotor.v - joint.v) / (IMPEDANCE * h)
    low = 0.0
    below = _lacks(joint, rotor, push, low, side, h)
    if below >= 0.0:
        return 0.0  # they part
    high = math.inf
    above = 0.0
    # between two pulls at which a friction begins or ends to slide, all is linear
    for way in (-1.0, 1.0):
        for body, sign in ((rotor, side), (joint, -side)):
            press = sign * _yields(body, way, h)
            if low < press < high:
                lack = _lacks(joint, rotor, push, press, side, h)
                if lack < 0.0:
                    low, below = press, lack
                else:
                    high, above = press, lack
    if high == math.inf:
        return side * (low - below * IMPEDANCE / (joint.mobility + rotor.mobility))
    return side * (low - below * (high - low) / (above - below))
