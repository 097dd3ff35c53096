"""What section 3 claims of the law's structure: any relative degree, damping without tuning, differentiators."""

from smc_mujoco.analysis.linear_theory import smallest_lam
from smc_mujoco.control.estimator import estimator
from smc_mujoco.control.law import law as find_law
from smc_mujoco.mechanisms.hardware.drives import Lag
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.simulation.perturbations import Noise
from smc_mujoco.studies.audit.verdict import UNIVERSAL, Beside, Check, check
from smc_mujoco.studies.paper.claims.audit import claim
from smc_mujoco.studies.paper.claims.lyapunov import input_gain
from smc_mujoco.studies.paper.claims.runs import OURS, Runs, comes_to_rest
from smc_mujoco.studies.paper.claims.searches import MIN_LAMBDA, smallest_stable
from smc_mujoco.studies.paper.scenarios import PLANTS, U_MAX

SINGLE = ("inverted_pendulum", "van_der_pol", "duffing")
LAG = 0.05  # s, chosen: an actuator's
SHARE = 1.5  # times the largest jerk that the lag allows, g u_max / LAG: the bound that the differentiator assumes
ESTIMATORS = ("filtered_difference", "savitzky_golay", "levant")
SIGMAS = (0.001, 0.01)  # rad or m


@claim(
    "15",
    "general relative degree r",
    where="section 3",
    holds_if="settles, ultimate bound <= 5 % of |x0|",
)
def higher_degree(runs: Runs) -> list[Check]:
    """Relative degree 3: an actuator's lag of 50 ms before pendulum, Van der Pol and Duffing; alpha = x'' + k2 x' + k1
    x, with x' and x'' from Levant's differentiator.

    The law of third order has no gains in the sets: its own (lambda 6, k1 6.25, k2 5) stand for all of them.
    """
    third = runs.mutated(find_law("observer_free_third"))
    grid = {}
    for name in SINGLE:
        jerk = input_gain(find_plant(name)) * U_MAX / LAG
        velocity = estimator("levant", L=SHARE * jerk)
        grid[name] = runs.scenario(name, OURS, law=third, actuator=Lag(LAG), velocity=velocity)
    times = [scores["settling_time"] for scores in runs.scores(grid.values())]
    settle = [
        check(f"{name}: settling time, s, within the run", time, "<", scenario.duration)
        for (name, scenario), time in zip(grid.items(), times, strict=True)
    ]
    return settle + comes_to_rest(runs, grid)


@claim(
    "24",
    "damping arises from alpha, no tuning",
    where="section 3",
    holds_if="any lambda > 0",
    quantifier=UNIVERSAL,
)
def no_tuning(runs: Runs) -> list[Check | Beside]:
    """Smallest lambda with which a start near the origin, 0.001 x0, dies out, by search from 0.001 to 6 at the k1 of
    the set; linear theory beside it.

    0.001 stands for any lambda > 0. A plant that needs one has a smallest lambda far above it.
    """
    theory = {name: smallest_lam(find_plant(name), runs.law(name, OURS).gains["k1"]) for name in PLANTS}
    return [
        *(
            check(f"{name}: smallest lambda that stabilises it", lam, "<=", MIN_LAMBDA)
            for name, lam in smallest_stable(runs).items()
        ),
        *(Beside(f"{name}: the same by linear theory", lam) for name, lam in theory.items()),
    ]


@claim(
    "25",
    "works with low-pass filtered differentiation, Savitzky-Golay, sliding differentiators",
    where="section 3",
    quick="of 0.01",
    holds_if="<= 5 % of |x0|",
)
def with_estimators(runs: Runs) -> list[Check]:
    """Ultimate bound with xdot from each estimator, as the library has it, of an x read with noise of 0.001 and
    0.01.
    """
    sigmas = SIGMAS[-1:] if runs.quick else SIGMAS
    grid = {
        f"{plant}, {name}, sigma {sigma:g}": runs.scenario(plant, OURS, velocity=name, noise=Noise(position=sigma))
        for plant in PLANTS
        for name in ESTIMATORS
        for sigma in sigmas
    }
    return comes_to_rest(runs, grid)
