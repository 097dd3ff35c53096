"""PD with a disturbance observer: u = -(wc^2 e + 2 wc de + z) / b, z' = l (de' - b u - z).

z estimates the total disturbance d = e'' - b u of the last period from the difference of two rates,
through a filter of first order with the bandwidth l. A constant d leaves no error. Three laws of
other names are this one:

- Incremental nonlinear dynamic inversion, u = F(u) + (v - F(e'')) / b, with one synchronised filter
  F of first order on both and v = -wc^2 e - 2 wc de. Time-delay control and the incremental PID are
  the same.
- L1 adaptive control with piecewise-constant adaptation on a matched channel: its estimate is
  exp(-am dt) times the last period's mean disturbance, am the pole of its predictor, and its filter
  is l.
- ADRC with a measured rate, whose observer is of first order.

On e'' = g u with l = 2 wc it is stable for 0.10 < g / b; sampled, g / b must also be below about 2
/ (1 - exp(-l dt)). A delay times wc must stay below 0.31. It needs a good rate: it loses its margin
with an encoder's differences, delays and slow drives, and is at home under loads that change. With
the model b = g, and f and r'' are known and fed forward. With a switching term in place of wc^2 e
it is `disturbance_observer`. The trace's s is wc^2 e + 2 wc de.
Gains: wc, bandwidth of the loop [1/s]; l, bandwidth of the observer [1/s]; b, assumed input gain
[1/kg].
Sources: E. Smeur, Q. Chu & G. de Croon, "Adaptive incremental nonlinear dynamic inversion for
attitude control of micro air vehicles", J. Guid. Control Dyn. 39(3):450, 2016 (synchronised
filters); P. Acquatella, W. van Ekeren & Q. P. Chu, "PI(D) tuning for flight control systems via
incremental nonlinear dynamic inversion", arXiv 1701.08981; H. Shim & N. H. Jo, "An almost necessary
and sufficient condition for robust stability of closed-loop systems with disturbance observer",
Automatica 45(1):296, 2009. The identities and margins are worked out here.
"""

import math

from smc_mujoco.control.law import assumed, clipped, law_function
from smc_mujoco.control.units import ASSUMED_B, RATE, Gain


@law_function(
    family="disturbance-observer",
    continuous=True,
    accuracy=0,
    label="PD with observer",
    short="PO",
    gains={
        "wc": Gain(5.0, RATE, positive=True),
        "l": Gain(20.0, RATE, positive=True),
        "b": ASSUMED_B,
    },
    memory=4,
    relative_degree=2,
)
def pd_observer(y, gains, memory):
    # memory: started, the last rate, the known acceleration of the last period, and z
    b, f = assumed(y, gains.b)
    if memory[0] != 0.0:
        memory[3] += (1.0 - math.exp(-gains.l * y.dt)) * (
            (y.de - memory[1]) / y.dt - memory[2] - memory[3]
        )
    s = gains.wc * gains.wc * y.e + 2.0 * gains.wc * y.de
    u = -(s + memory[3] + f) / b
    memory[0] = 1.0
    memory[1] = y.de
    memory[2] = b * clipped(y, u) + f
    return u, s
