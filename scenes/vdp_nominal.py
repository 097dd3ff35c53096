"""How does the observer-free law stop the Van der Pol oscillator when nothing disturbs it?

The paper's figure 5, and the reference for vdp_noise and vdp_disturbance. The paper reports smooth and fast
convergence without chattering. The rivals run beside it.

Look for: a u without corners, and how much later x arrives than u leaves its bound. Super-twisting limit-cycles: its
integrator winds up while u is clipped at 6 N, which the plain law does not prevent.
"""

import smc_mujoco as smc

scene = smc.Scene(
    title="Van der Pol, nominal",
    conditions={"nominal": smc.paper.comparison("van_der_pol", "nominal")},
)

if __name__ == "__main__":
    smc.play(__file__)
