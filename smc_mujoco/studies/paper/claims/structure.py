"""What section 3 claims of the law's structure: any relative degree, damping without tuning, differentiators."""

from smc_mujoco.analysis.linear_theory import smallest_lam
from smc_mujoco.control.estimator import estimator
from smc_mujoco.control.law import law as find_law
from smc_mujoco.mechanisms.hardware.drives import Lag
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.simulation.perturbations import Noise
from smc_mujoco.studies.paper.claims.audit import claim
from smc_mujoco.studies.paper.claims.lyapunov import input_gain
from smc_mujoco.studies.paper.claims.runs import OURS, Runs, comes_to_rest, scale
from smc_mujoco.studies.paper.claims.searches import LEAST, smallest_stable
from smc_mujoco.studies.paper.claims.verdict import UNIVERSAL, Beside, Check, check
from smc_mujoco.studies.paper.scenarios import PLANTS, U_MAX

SINGLE = ("inverted_pendulum", "van_der_pol", "duffing")
LAG = 0.05  # s, chosen: an actuator's
SHARE = 1.5  # times the largest jerk that the lag allows, g u_max / LAG: what the differentiator is told to expect
ESTIMATORS = ("filtered_difference", "savitzky_golay", "levant")
SIGMAS = (0.001, 0.01)  # rad or m


@claim(
    "15",
    "general relative degree r",
    where="section 3",
    measured="relative degree 3: an actuator's lag of 50 ms before pendulum, Van der Pol and Duffing; alpha = x'' + k2 "
    "x' + k1 x, with x' and x'' from Levant's differentiator",
    holds_if="settles, ultimate bound <= 5 % of |x0|",
    note="The law of third order has no gains in the sets: its own (lambda 6, k1 6.25, k2 5) stand for all of them.",
)
def higher_degree(runs: Runs) -> list[Check]:
    """Settling time against the run's length, and ultimate bound."""
    third = runs.mutated(find_law("observer_free_third"))
    grid = [
        runs.scenario(name, OURS, law=third, actuator=Lag(LAG), velocity=estimator("levant", L=SHARE * jerk(name)))
        for name in SINGLE
    ]
    found = []
    for name, scenario, scores in zip(SINGLE, grid, runs.scores(grid), strict=True):
        bound = scores["ultimate_bound"] / scale(scenario)
        found += [
            check(f"{name}: settling time, s, within the run", scores["settling_time"], "<", scenario.duration),
            check(f"{name}: ultimate bound / |x0|", bound, "<=", 0.05),
        ]
    return found


def jerk(name: str) -> float:
    """The largest jerk that a full command behind the lag gives a plant at rest, g u_max / LAG."""
    return input_gain(find_plant(name)) * U_MAX / LAG


@claim(
    "24",
    "damping arises from alpha, no tuning",
    where="section 3",
    measured="smallest lambda with which a start near the origin, 0.001 x0, dies out, by search from 0.001 to 6 at the "
    "k1 of the set; linear theory beside it",
    holds_if="any lambda > 0",
    quantifier=UNIVERSAL,
    note="0.001 stands for any lambda > 0. A plant that needs one has a smallest lambda far above it.",
)
def no_tuning(runs: Runs) -> list[Check | Beside]:
    """The smallest lambda that stabilises each plant."""
    k1 = {name: runs.law(name, OURS).gains["k1"] for name in PLANTS}
    found = smallest_stable(runs)
    return [
        *(check(f"{name}: smallest lambda that stabilises it", found[name], "<=", LEAST) for name in PLANTS),
        *(Beside(f"{name}: the same by linear theory", smallest_lam(find_plant(name), k1[name])) for name in PLANTS),
    ]


@claim(
    "25",
    "works with low-pass filtered differentiation, Savitzky-Golay, sliding differentiators",
    where="section 3",
    measured="ultimate bound with xdot from each estimator, as the library has it, of an x read with noise of 0.001 "
    "and 0.01",
    quick="of 0.01",
    holds_if="<= 5 % of |x0|",
)
def with_estimators(runs: Runs) -> list[Check]:
    """Largest |x| in the last 20 % of the run over |x0|."""
    sigmas = SIGMAS[-1:] if runs.quick else SIGMAS
    grid = {
        f"{plant}, {name}, sigma {sigma:g}": runs.scenario(plant, OURS, velocity=name, noise=Noise(position=sigma))
        for plant in PLANTS
        for name in ESTIMATORS
        for sigma in sigmas
    }
    return comes_to_rest(runs, grid)
