"""Does any law stop the Van der Pol oscillator better than the others?

The paper's second comparison (figure 2): M x'' = mu (1 - x^2) x' - k x + u from x = 2 m. It reports a moderate
undershoot of the observer-free law, the largest oscillation under the higher-order law, a higher overshoot of the
adaptive law, and a slow classical law without overshoot.

Look for: inside |x| < 1 (the rail's coloured band) the plant feeds energy in, and a bounded u must overcome that.
Super-twisting limit-cycles: its integrator winds up while u is clipped at 6 N, which the plain law does not prevent.
"""

import smc_mujoco as smc

scene = smc.Scene(
    title="Van der Pol oscillator",
    conditions={"nominal": smc.paper.comparison("van_der_pol")},
)

if __name__ == "__main__":
    smc.play(__file__)
