"""Controllers of real rigs, as laws, with which records of their closed loops are replayed.

They are not in the catalogue of laws, because the gains of each belong to one machine.
"""

from smc_mujoco.control.law import law_function
from smc_mujoco.control.units import Gain


@law_function(
    gains={
        "kp": Gain(6.0), "kd": Gain(1.8), "kp_free": Gain(30.0), "kd_free": Gain(2.5),
        "cutoff": Gain(50.0, positive=True),
    },
    memory=5,
    plants=("furuta", "cart_pole"),
    label="Rig's state feedback",
)  # fmt: skip
def state_feedback(y, gains, memory):
    """State feedback of a driven and of a free joint: u = kp e + kd d(e) + kp_free q + kd_free d(q).

    d(z) is a filtered difference, d_k = (cutoff (z_k - z_(k-1)) + d_(k-1)) / (1 + cutoff h), 0 at the first sample.
    The gains are positive, as an arm must first move with the pendulum that it balances.
    Source: the controller of the public records of decargroup/closed_loop_koopman (MIT), whose gains are the defaults,
    in V/rad, V s/rad and 1/s.
    """
    started, e_, q_, de, dq = memory[0], memory[1], memory[2], memory[3], memory[4]
    if started != 0.0:
        de = (gains.cutoff * (y.e - e_) + de) / (1.0 + gains.cutoff * y.dt)
        dq = (gains.cutoff * (y.q - q_) + dq) / (1.0 + gains.cutoff * y.dt)
    memory[0], memory[1], memory[2], memory[3], memory[4] = 1.0, y.e, y.q, de, dq
    return gains.kp * y.e + gains.kd * de + gains.kp_free * y.q + gains.kd_free * dq, 0.0


@law_function(gains={"kp": Gain(160.18, positive=True), "kv": Gain(243.45, positive=True)}, label="Rig's cascade")
def cascade(y, gains, memory):
    """Position loop about a velocity loop: u = kv (kp (r - x) - v).

    Source: the drive of EMPS (Janot, Gautier and Brunot 2019), whose gains are the defaults: 1/s, and V s/m.
    """
    return gains.kv * (-gains.kp * y.e - y.v), 0.0
