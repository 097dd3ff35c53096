"""Terminal: u = v_eq - k sgn(s), s = de + b [e]^p, v_eq = -b p |e|^(p-1) de bounded by `bound`, 1/2
< p < 1.

s = 0 is reached in finite time for e'' = u + d, |d| <= D < k. From there e = 0 after |e|^(1-p) / (b
(1-p)). Sampled, |s| = O(dt), and so |e| = O(dt^(1/p)) (derived here). v_eq is singular at e = 0
away from the surface. On the surface it is b^2 p [e]^(2p-1), and the bound acts on large errors
alone. Without the model, e'' = f + g u + d contains (g - 1) v_eq too: the condition is k g > |f +
d| + |g - 1| |v_eq|.
Gains: k, switching gain [N]; b, of the surface [m^(1-p)/s]; p, exponent; bound, on |v_eq| [N].
Sources: S. Venkataraman & S. Gulati, "Control of nonlinear systems using terminal sliding modes",
J. Dyn. Syst. Meas. Control 115(3):554, 1993 (law); Y. Feng, X. Yu & F. Han, "On nonsingular
terminal sliding-mode control of nonlinear systems", Automatica 49(6):1715, 2013 (bound).
"""

from smc_mujoco.control.law import command, law_function, power, sgn
from smc_mujoco.control.surfaces import terminal as surface
from smc_mujoco.control.units import FORCE, Gain


@law_function(
    family="terminal",
    finite_time="e",
    accuracy={"s": 1, "e": lambda g: 1.0 / g.p},
    admits={"d": lambda g: g.k},
    gains={
        "k": Gain(4.0, FORCE, positive=True),
        **surface.terminal.gains,
        "bound": Gain(20.0, FORCE, positive=True),
    },
    memory=1,
    relative_degree=2,
    conditions=surface.terminal.conditions,
    short="TE",
)
def terminal(y, gains, memory):
    s = y.de + gains.b * power(y.e, gains.p)
    v_eq = 0.0
    if y.e != 0.0:
        v_eq = -gains.b * gains.p * abs(y.e) ** (gains.p - 1.0) * y.de
    return command(y, min(max(v_eq, -gains.bound), gains.bound) - gains.k * sgn(s)), s
