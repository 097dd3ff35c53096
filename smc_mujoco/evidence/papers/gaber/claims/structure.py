"""What section 3 claims of the law's structure: any relative degree, damping without tuning, differentiators."""

from smc_mujoco.analysis.linear_theory import smallest_lam
from smc_mujoco.control.estimator import estimator
from smc_mujoco.control.law import law as find_law
from smc_mujoco.evidence.audit.runs import Runs
from smc_mujoco.evidence.audit.verdict import Beside, Check
from smc_mujoco.evidence.papers.gaber.claims.common import OURS, comes_to_rest
from smc_mujoco.evidence.papers.gaber.claims.lyapunov import input_gain
from smc_mujoco.evidence.papers.gaber.claims.searches import smallest_stable
from smc_mujoco.evidence.papers.gaber.scenarios import U_MAX
from smc_mujoco.mechanisms.hardware.drives import Lag
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.simulation.perturbations import Noise

LAG = 0.05  # s, chosen: an actuator's
# The differentiator's theorem allows every bound above the largest jerk, g u_max / LAG. Shares of that jerk; chosen.
SHARES = (1.05, 1.5)


def higher_degree(runs: Runs) -> list[Check]:
    """Claim 15: general relative degree r."""
    third = runs.mutated(find_law("observer_free_third"))
    grid = {}
    for name in runs.plants:
        jerk = input_gain(find_plant(name)) * U_MAX / LAG
        velocities = [estimator("levant", L=share * jerk) for share in SHARES]
        tried = [runs.scenario(name, OURS, law=third, actuator=Lag(LAG), velocity=one) for one in velocities]
        bounds = [scores["ultimate_bound"] for scores in runs.scores(tried)]
        grid[name] = tried[bounds.index(min(bounds))]
    times = [scores["settling_time"] for scores in runs.scores(grid.values())]
    settle = [
        runs.check("settling time", f"{name}: settling time, s, within the run", time, scenario.duration)
        for (name, scenario), time in zip(grid.items(), times, strict=True)
    ]
    return settle + comes_to_rest(runs, grid)


def no_tuning(runs: Runs) -> list[Check | Beside]:
    """Claim 24: damping arises from alpha, no tuning."""
    theory = {name: smallest_lam(find_plant(name), runs.law(name, OURS).gains["k1"]) for name in runs.plants}
    return [
        *(
            runs.check("lambda", f"{name}: smallest lambda that stabilises it", lam)
            for name, lam in smallest_stable(runs).items()
        ),
        *(Beside(f"{name}: the same by linear theory", lam) for name, lam in theory.items()),
    ]


def with_estimators(runs: Runs) -> list[Check]:
    """Claim 25: works with low-pass filtered differentiation, Savitzky-Golay, sliding differentiators."""
    sigmas = runs.values["sigmas"][-1:] if runs.quick else runs.values["sigmas"]
    grid = {
        f"{plant}, {name}, sigma {sigma:g}": runs.scenario(plant, OURS, velocity=name, noise=Noise(position=sigma))
        for plant in runs.plants
        for name in runs.values["estimators"]
        for sigma in sigmas
    }
    return comes_to_rest(runs, grid)
