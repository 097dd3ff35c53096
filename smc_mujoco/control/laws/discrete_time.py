"""Discrete-time sliding mode: u = -k sat((s / dt + d_) / k), d_ = (s - s_) / dt - u_; s = de + c e,
_ a sample earlier.

d_ is the exact mean disturbance of the last period, used as a prediction for the next. If |u| < k,
s+ = dt (d - d_) after one sample (deadbeat). For |d'| <= L the residual is |s| <= dt^2 L, of second
order, without chattering. u_ is the saturated command, limited by k and by the actuator's bound, so
nothing winds up. The law needs to know g, because d_ contains (g - 1) u_ too: the linear loop z^2 +
2 (g - 1) z + 1 - g is stable only for 0 < g < 4/3. For larger g, u swings between its bounds.
Gains: k, bound of u [N]; c, slope of the surface [1/s].
Source: W.-C. Su, S. V. Drakunov & U. Ozguner, "An O(T^2) boundary layer in sliding mode for
sampled-data systems", IEEE Trans. Autom. Control 45(3):482, 2000 (law and order); V. Utkin & S.
Drakunov, "On discrete-time sliding modes", IFAC Nonlinear Control Systems Design 1989 (bounded u);
the condition on g: Jury's, derived here.
"""

from smc_mujoco.control.law import command, excess, law_function, sliding
from smc_mujoco.control.units import FORCE, SLOPE, Gain


@law_function(
    family="first-order",
    finite_time="s",
    accuracy=2,
    label="Discrete-time",
    gains={
        "k": Gain(4.0, FORCE, nonnegative=True),
        "c": SLOPE,
    },
    memory=3,
)
def discrete_time(y, gains, memory):
    s, v_eq = sliding(y, gains.c)
    d = (s - memory[0]) / y.dt - memory[1] if memory[2] != 0.0 else 0.0
    v = min(max(-(s / y.dt + d), -gains.k), gains.k)
    u = command(y, v_eq + v)
    applied = v
    if abs(u) > y.limit:
        applied = v + excess(y, u)
    memory[0] = s
    memory[1] = applied
    memory[2] = 1.0
    return u, s
