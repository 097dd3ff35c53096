"""Observer-free law of J. Gaber on every joint: u = -lam tanh(s) + g, s = de + k1 e, g gravity.

In a scenario with model="nominal", g compensates gravity and springs. The law uses nothing else of
the model. By default a scenario gives it no model, and g = 0. For a constant reference and exact g,

    V = v' M v / 2 + sum over joints of lam / k1 ln cosh(k1 e),
    V' = -sum of lam v (tanh s - tanh(k1 e)) <= 0,

so that the arm comes to rest at r from every start, for every M and C (derived here; the unmodelled
damping helps). If g = 0, the arm rests where lam tanh(k1 e) = -g(x), with g(x) its gravity: at |e|
= |g| / (lam k1) for small e, and nowhere near r if |g| >= lam.
Gains: lam, bound of u without g [N m]; k1, slope of the surface [1/s].
Source: J. Gaber, "Observer-Free Sliding Mode Control via Structured Decomposition", eq. 4; gravity
as in M. Takegaki & S. Arimoto, "A new feedback method for dynamic control of manipulators", J. Dyn.
Syst. Meas. Control 103(2):119, 1981.
"""

from smc_mujoco.control.joint_law import tanh
from smc_mujoco.control.law import law_function
from smc_mujoco.control.units import OBSERVER_FREE


@law_function(
    joint=True,
    family="observer-free",
    continuous=True,
    accuracy=0,
    gains=OBSERVER_FREE,
    label="Observer-free (every joint)",
    colour="#0072B2",
)
def observer_free_joint(y, gains, memory):
    s = y.de + gains.k1 * y.e
    return y.g - gains.lam * tanh(s), s
