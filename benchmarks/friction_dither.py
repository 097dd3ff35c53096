"""What benchmarks/friction.py sets beside a law or in it: a square wave that is added to u, and a
slope in place of the sign in super-twisting's integral.
"""

import math

import smc_mujoco as smc
from smc_mujoco.common.data import frozen_data
from smc_mujoco.control.component import Component
from smc_mujoco.control.law import command, sliding
from smc_mujoco.mechanisms.hardware.part import Positive
from smc_mujoco.simulation.signals import Signal

DITHER = 8e-3  # s, of a square wave: four periods of control to either side
AMPLITUDES = (0.5, 1.0, 1.5)  # of a square wave, over the dry friction
SLOPES = (1e-3, 1e-2, 0.1)  # widths, of the start over the time scale


@frozen_data
class Square(Signal):
    """amplitude in the first half of each period, -amplitude in the second."""

    amplitude: float
    period: Positive

    @staticmethod
    def value(t, p):
        half = math.floor(2.0 * t / p.period + 1e-6)
        return (p.amplitude if half % 2 == 0 else -p.amplitude), 0.0, 0.0


@smc.law_function(gains={"k1": 3.0, "k2": 4.4, "c": 1.0, "w_max": math.inf, "eps": 1e-3}, memory=1)
def sloped_super_twisting(y, gains, memory):
    """Super-twisting whose integral has a slope of width eps in place of the sign."""
    s, v_eq = sliding(y, gains.c)
    v = v_eq - gains.k1 * math.copysign(math.sqrt(abs(s)), s) + memory[0]
    side = min(max(s / gains.eps, -1.0), 1.0)
    memory[0] = min(max(memory[0] - y.dt * gains.k2 * side, -gains.w_max), gains.w_max)
    return command(y, v), s


def sloped(law: Component, width: float) -> Component:
    """Return super-twisting with a slope of this width, m/s (rad/s)."""
    return sloped_super_twisting(**law.gains, eps=width)
