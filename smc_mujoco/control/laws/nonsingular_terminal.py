"""Non-singular terminal: u = v_eq - k sgn(s), s = e + [de]^p / B, v_eq = -(B/p) [de]^(2-p), 1 < p <
2.

s = 0 is reached in finite time for e'' = u + d, |d| <= D < k. From there e = 0 after |e|^(1-1/p) /
(B^(1/p) (1-1/p)). u is finite everywhere. s' = (p/B) |de|^(p-1) (e'' - v_eq), so s does not move
while the joint is at rest, until the law has accelerated it. Sampled, |de| = O(dt), and so |s| and
|e| are O(dt^p) (derived here). Without the model, e'' = f + g u + d contains (g - 1) v_eq too: the
condition is k g > |f + d| + |g - 1| |v_eq|, where |v_eq| is (B/p) |B e|^((2-p)/p) on s = 0.
Gains: k, switching gain [N]; B, of the surface [m^(p-1)/s^p]; p, exponent.
Source: Y. Feng, X. Yu & Z. Man, "Non-singular terminal sliding mode control of rigid manipulators",
Automatica 38(12):2159, 2002.
"""

from smc_mujoco.control.law import command, law_function, power, sgn
from smc_mujoco.control.surfaces import nonsingular_terminal as surface
from smc_mujoco.control.units import FORCE, Gain


@law_function(
    family="terminal",
    finite_time="e",
    accuracy=lambda g: g.p,
    gains={
        "k": Gain(4.0, FORCE, positive=True),
        **surface.nonsingular_terminal.gains,
    },
    memory=1,
    relative_degree=2,
    conditions=surface.nonsingular_terminal.conditions,
)
def nonsingular_terminal(y, gains, memory):
    s = y.e + power(y.de, gains.p) / gains.B
    v_eq = -gains.B / gains.p * power(y.de, 2.0 - gains.p)
    return command(y, v_eq - gains.k * sgn(s)), s
