"""Non-singular fast terminal: u = v_eq - k sgn(s) - rate s, s = e + a [e]^q + b [de]^p, 1 < p < 2,
q > p.

v_eq = -[de]^(2-p) (1 + a q |e|^(q-1)) / (b p), and s' = b p |de|^(p-1) (e'' - v_eq). s = 0 is
reached in finite time for e'' = u + d, |d| <= D < k, and sooner from far away because of the term
rate s. On s = 0, de = -[(e + a [e]^q) / b]^(1/p), so e reaches 0 in finite time, faster from far
away than with a = 0. Sampled, |de| = O(dt), and so |s| and |e| are O(dt^p) (derived here). Without
the model, e'' = f + g u + d contains (g - 1) v_eq too: the condition is k g > |f + d| + |g - 1|
|v_eq|, with the de above on s = 0.
Gains: k, switching gain [N]; rate, reaching rate [N/m]; a [m^(1-q)] and b [m^(1-p) s^p], of the
surface; p and q, exponents.
Source: L. Yang & J. Yang, "Nonsingular fast terminal sliding-mode control for nonlinear dynamical
systems", Int. J. Robust Nonlinear Control 21(16):1865, 2011, with k sgn(s) for k2 [s]^rho of its
reaching law.
"""

from smc_mujoco.control.law import command, law_function, power, sgn
from smc_mujoco.control.surfaces import nonsingular_fast_terminal as surface
from smc_mujoco.control.units import FORCE, FORCE_PER_POSITION, Gain


@law_function(
    family="terminal",
    finite_time="e",
    accuracy=lambda g: g.p,
    gains={
        "k": Gain(4.0, FORCE, positive=True),
        "rate": Gain(3.0, FORCE_PER_POSITION, nonnegative=True),
        **surface.nonsingular_fast_terminal.gains,
    },
    memory=1,
    relative_degree=2,
    conditions=surface.nonsingular_fast_terminal.conditions,
)
def nonsingular_fast_terminal(y, gains, memory):
    s = y.e + gains.a * power(y.e, gains.q) + gains.b * power(y.de, gains.p)
    slope = 1.0 + gains.a * gains.q * abs(y.e) ** (gains.q - 1.0)
    v_eq = -power(y.de, 2.0 - gains.p) * slope / (gains.b * gains.p)
    return command(y, v_eq - (gains.k * sgn(s) + gains.rate * s)), s
