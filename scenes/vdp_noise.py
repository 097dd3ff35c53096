"""Does Gaussian noise on both sensors matter to the observer-free law?

The paper's figure 6. Standard deviations 0.01 m and 0.05 m/s. The paper reports that the system remains stable with
small fluctuations. The rivals run beside it under the same condition.

Look for: the fluctuation of x is small; that of u is lam times the noise in s, and no small one. Super-twisting
limit-cycles: its integrator winds up while u is clipped at 6 N, which the plain law does not prevent.
"""

import smc_mujoco as smc

scene = smc.Scene(
    title="Van der Pol under measurement noise",
    conditions={"noise": smc.paper.comparison("van_der_pol", "noise")},
)

if __name__ == "__main__":
    smc.play(__file__)
