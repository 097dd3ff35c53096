"""Controllers of real rigs, as laws, with which records of their closed loops are replayed, and
laws beside them.

The controllers are not in the catalogue of laws, because the gains of each belong to one machine.
"""

import math
from collections.abc import Mapping

from smc_mujoco.control.law import Law, law_function
from smc_mujoco.control.laws.rotary_swing_up import rotary_swing_up
from smc_mujoco.control.source import SHIPPED
from smc_mujoco.control.units import FORCE_PER_POSITION, FORCE_PER_SPEED, RATE, Gain

KINDS = {  # of the catalogue's law for a rotary pendulum -> its gains in scene furuta, N m
    "relay": {"k": 0.04, "phi": 1e-4, "k1": 0.0, "k2": 0.0},
    "boundary layer": {"k": 0.05, "phi": 0.025, "k1": 0.0, "k2": 0.0},
    "super-twisting": {"k": 0.0, "phi": 1.0, "k1": 0.2, "k2": 0.1},
    "regulator": {"k": 1.0, "phi": 1.0, "k1": 0.0, "k2": 0.0},
}


def rotary(torque: float, surface: Mapping[str, float]) -> tuple[Law, ...]:
    """Return the laws of scene furuta for a machine with `torque` N m per unit of u, on its own
    surface c1 .. c4.

    The surface is that of least quadratic cost for its quantities, with the weights of
    `rotary_swing_up`.
    """
    force = 1.0 / torque
    laws = []
    for name, gains in KINDS.items():
        own = {
            **{key: value * force for key, value in gains.items()},
            "k1": gains["k1"] * math.sqrt(force),
        }
        law = rotary_swing_up(**own, w_max=0.03 * force, catch=0.05 * force, **surface)
        laws.append(law.named(name).sourced(SHIPPED))
    return tuple(laws)


@law_function(
    gains={
        "kp": Gain(6.0, FORCE_PER_POSITION),
        "kd": Gain(1.8, FORCE_PER_SPEED),
        "kp_free": Gain(30.0, FORCE_PER_POSITION),
        "kd_free": Gain(2.5, FORCE_PER_SPEED),
        "cutoff": Gain(50.0, RATE, positive=True, held=True),
    },
    memory=5,
    plants=("furuta", "cart_pole"),
    label="Rig's state feedback",
)
def state_feedback(y, gains, memory):
    """State feedback of a driven and of a free joint: u = kp e + kd d(e) + kp_free q + kd_free
    d(q).

    d(z) is a filtered difference, d_k = (cutoff (z_k - z_(k-1)) + d_(k-1)) / (1 + cutoff h), 0 at
    the first sample. The gains are positive, as an arm must first move with the pendulum that it
    balances. Source: the controller of the public records of decargroup/closed_loop_koopman (MIT),
    whose gains are the defaults, in V/rad, V s/rad and 1/s.
    """
    started = memory[0]
    e_ = memory[1]
    q_ = memory[2]
    de = memory[3]
    dq = memory[4]
    if started != 0.0:
        de = (gains.cutoff * (y.e - e_) + de) / (1.0 + gains.cutoff * y.dt)
        dq = (gains.cutoff * (y.q - q_) + dq) / (1.0 + gains.cutoff * y.dt)
    memory[0] = 1.0
    memory[1] = y.e
    memory[2] = y.q
    memory[3] = de
    memory[4] = dq
    return gains.kp * y.e + gains.kd * de + gains.kp_free * y.q + gains.kd_free * dq, 0.0


@law_function(
    gains={"kp": Gain(160.18, positive=True), "kv": Gain(243.45, positive=True)},
    label="Rig's cascade",
)
def cascade(y, gains, memory):
    """Position loop about a velocity loop: u = kv (kp (r - x) - v).

    Source: the drive of EMPS (Janot, Gautier and Brunot 2019), whose gains are the defaults: 1/s,
    and V s/m.
    """
    return gains.kv * (-gains.kp * y.e - y.v), 0.0
