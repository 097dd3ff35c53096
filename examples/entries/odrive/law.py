import smc_mujoco as smc
from smc_mujoco.control.units import FORCE_PER_POSITION, FORCE_PER_SPEED, RATE, Gain

GAINS = {
    "pos_gain": Gain(3.0, RATE),
    "vel_gain": Gain(4.0, FORCE_PER_SPEED),
    "vel_integrator_gain": Gain(4.0, FORCE_PER_POSITION),
}


@smc.law_function(gains=GAINS, memory=1)
def odrive(y, gains, memory):
    """P on position, PI on velocity; a saturated integral fades by 1 % a sample."""
    v_err = -gains.pos_gain * y.e - y.de
    u = gains.vel_gain * v_err + memory[0]
    if abs(u) > y.limit:
        memory[0] *= 0.99
    else:
        memory[0] += gains.vel_integrator_gain * y.dt * v_err
    return u, -v_err
