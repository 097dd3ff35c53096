"""A law of one channel as the outer law of computed torque, for mechanisms of many joints.

    smc.law("adrc", wc=12.0).on_computed_torque()

u = M(x) (v + r'') + h(x, v) with the nominal M and h, and v_i the outer law's command for joint i.
With the perfect model each joint obeys e'' = v + d_a, d_a = M^-1 d, whatever the others do. So the
outer law meets the double integrator of its theorem, with b = 1. What it estimates or integrates is
friction, payload and the model's error, as an acceleration. Its bound is the acceleration that its
motor can still give while the others rest, (u_max - |h_i|) / M_ii. So its anti-windup is right for
one joint that saturates, and approximate for several.
"""

# pyright: reportCallIssue=false
# (the fields of a law's gains are known when it is made)
import functools
from collections.abc import Callable

from numba import njit

from smc_mujoco.common.jit import named
from smc_mujoco.control.joint_law import torque
from smc_mujoco.control.measurement import Measurement


@functools.cache  # one function for each law, so that equal laws are equal
def on_computed_torque(function: Callable, gains: tuple[str, ...], values: str) -> Callable:
    """Return the function of the law of many joints whose outer law is a function of one channel.

    Args:
      function: of the outer law.
      gains: the names of its gains.
      values: what these are for joint i, separated by commas, in terms of `gains` and `i`.
    """
    outer = njit(function)
    space = {"Gains": named(gains), "inf": float("inf")}
    exec(f"def of_joint(gains, i): return Gains({values})", space)
    of_joint = njit(space["of_joint"])

    def law(y, gains, memory):
        v = 0.0 * y.e
        s = 0.0 * y.e
        for i in range(len(v)):
            seen = Measurement(
                y.t,
                y.dt,
                y.x[i],
                y.v[i],
                y.e[i],
                y.de[i],
                y.r[i],
                y.dr[i],
                0.0,  # r'', f and g: the plant is e'' = v
                0.0,
                1.0,
                y.a[i] - y.ddr[i],
                max(y.limit[i] - abs(y.h[i]), 0.0) / y.M[i, i],
                1.0,  # of the model
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
            )
            v[i], s[i] = outer(seen, of_joint(gains, i), memory[i])
        return torque(y, v), s

    law.__name__ = law.__qualname__ = f"{function.__name__}_computed_torque"
    law.__doc__ = (
        f"Computed torque with {function.__name__} as its outer law, "
        "see smc_mujoco.control.outer_law."
    )
    return law
