"""Linear active disturbance rejection (ADRC): u = -(wc^2 z1 + 2 wc z2 + z3) / b, with z of an
extended-state observer.

    z1' = z2 + 3 w (e - z1);  z2' = z3 + b u + 3 w^2 (e - z1);  z3' = w^3 (e - z1)

d = e'' - b u is the total disturbance: friction, gravity, the reference, and an input gain g other
than b. A constant d leaves no error; if |d'| <= J, b = g and the rate of e is not used, |d - z3| <=
3 J / w in the end. In continuous time the law is a PID controller with a filter of second order:

    u = -(wc^2 w^3 + (3 wc^2 w^2 + 2 wc w^3) p + (3 w wc^2 + 6 wc w^2 + w^3) p^2) / (b p (p^2 + (3 w
        + 2 wc) p + 3 w^2 + 6 w wc + wc^2)) e

with p = d/dt. On e'' = g u it is stable for 0.245 < g / b < 4.05 if w = 2 wc, and for 0.11 < g / b
< 6.2 if w = 10 wc; a delay times wc must stay below 0.39 and 0.19. The observer uses u after
saturation, so z3 does not wind up. It is discretised exactly for u constant over the period, with
all poles at exp(-w dt). It needs no rate but at the first sample. With the model b = g, and f and
r'' are known to the observer and fed forward. `extended_state` has this observer beside a switching
term, and feeds back the position by its sign alone. The trace's s is wc^2 z1 + 2 wc z2.
Gains: wc, bandwidth of the loop [1/s]; w, bandwidth of the observer [1/s]; b, assumed input gain
[1/kg].
Sources: J. Han, "From PID to active disturbance rejection control", IEEE Trans. Ind. Electron.
56(3):900, 2009; Z. Gao, "Scaling and bandwidth-parameterization based controller tuning", American
Control Conference 2003; R. Miklosovic, A. Radke & Z. Gao, "Discrete implementation and
generalization of the extended state observer", American Control Conference 2006; G. Herbst, "A
simulative study on active disturbance rejection control", Electronics 2:246, 2013. Transfer
function and margins are worked out here.
"""

from smc_mujoco.control.law import assumed, clipped, law_function
from smc_mujoco.control.laws.extended_state import corrections, observe
from smc_mujoco.control.units import ASSUMED_B, RATE, Gain


@law_function(
    family="disturbance-observer",
    continuous=True,
    accuracy=0,
    label="ADRC",
    short="AD",
    gains={
        "wc": Gain(5.0, RATE, positive=True),
        "w": Gain(40.0, RATE, positive=True),
        "b": ASSUMED_B,
    },
    memory=5,
    relative_degree=2,
)
def adrc(y, gains, memory):
    b, f = assumed(y, gains.b)
    l1, l2, l3 = corrections(gains.w, y.dt)
    d = observe(y, l1, l2, l3, memory)
    s = gains.wc * gains.wc * memory[1] + 2.0 * gains.wc * memory[2]
    u = -(s + d + f) / b
    memory[4] = b * clipped(y, u) + f
    return u, s
