"""Does the disturbance 0.2 sin(5t) matter to the observer-free law?

The paper's figure 7. The paper reports a trajectory nearly identical to the nominal one and strong rejection. The
rivals run beside it under the same condition.

Look for: the residual oscillation of x beside those of the switching laws, which have the same bound on u. Super-
twisting limit-cycles: its integrator winds up while u is clipped at 6 N, which the plain law does not prevent.
"""

import smc_mujoco as smc

scene = smc.Scene(
    title="Van der Pol under a sine disturbance",
    conditions={"sine": smc.paper.comparison("van_der_pol", "sine")},
)

if __name__ == "__main__":
    smc.play(__file__)
