"""What the stability analysis claims: V' <= -eps s^2, a V that only falls, global convergence, any g but 0."""

import numpy as np

from smc_mujoco.analysis.linear_theory import smallest_lam
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.studies.audit.verdict import UNIVERSAL, Beside, Check, check
from smc_mujoco.studies.paper.claims import lyapunov
from smc_mujoco.studies.paper.claims.audit import claim
from smc_mujoco.studies.paper.claims.runs import OURS, Runs, comes_to_rest, long_run
from smc_mujoco.studies.paper.claims.variants import reversed_gain
from smc_mujoco.studies.paper.scenarios import PLANTS

NEAR = 1e-6  # |s| at and below which the claim says nothing
RISE = 1e-12  # of the run's largest V: less is rounding
RATIOS = (0.5, 0.8, 1.0, 1.2)  # lambda over the smallest that linear theory finds stable
SPREAD, RATES = (0.25, 1.0, 2.0), (-1.0, 0.0, 1.0)  # initial states: times x0; times |x0| per s
CONVERGED = 0.05  # of |x0|


@claim(
    "18",
    "Vdot <= -eps s^2 for all s != 0",
    where="stability",
    quick="51 x 51 points",
    holds_if="no point with Vdot > 0 and |s| > 1e-6",
    quantifier=UNIVERSAL,
)
def decreases(runs: Runs) -> list[Check | Beside]:
    """Sign of Vdot on a grid of the state plane, 201 x 201, |x| up to 2 |x0| and |v| up to 2 k1 |x0|, with the exact f
    and g of each plant and the law not saturated; a network synchronised, in which a channel is one pendulum.

    Vdot has the sign of alpha alphadot. On alpha = 0 alphadot is f(x, -k1 x) - k1^2 x whatever lambda is, so that Vdot
    > 0 on one side of that line wherever this is not 0.
    """
    evidence = []
    for name in PLANTS:
        plant, gains = find_plant(name), runs.law(name, OURS).gains
        x, v = lyapunov.plane(plant, gains["k1"], points=51 if runs.quick else lyapunov.POINTS)
        states = plant, gains["lam"], gains["k1"], x, v
        rate = np.where(np.abs(lyapunov.surface(*states)) > NEAR, lyapunov.vdot(*states), -np.inf)
        worst = np.unravel_index(np.argmax(rate), rate.shape)
        evidence += [
            check(f"{name}: share of the plane with Vdot > 0", float(np.mean(rate > 0.0)), "<=", 0.0),
            Beside(f"{name}: largest Vdot", rate[worst]),
            Beside(f"{name}: largest Vdot, at x", x[worst]),
            Beside(f"{name}: largest Vdot, at v", v[worst]),
        ]
    return evidence


@claim(
    "19",
    "V decreases monotonically",
    where="stability",
    holds_if="0",
    quantifier=UNIVERSAL,
)
def monotonic(runs: Runs) -> list[Check]:
    """Fraction of the control periods of the nominal run in which V, of the true state, rises by more than rounding; of
    all channels of a network.
    """
    checks = []
    for trace in runs.traces([runs.scenario(name, OURS) for name in PLANTS]):
        plant, gains = trace.scenario.plant, trace.scenario.law.gains
        s = trace.v + gains["k1"] * trace.x - trace.u / lyapunov.input_gain(plant)  # alpha - u / g, u of the actuator
        height = s**2 / 2.0
        rises = np.diff(height, axis=0) > RISE * height.max()
        checks.append(check(f"{plant.name}: fraction of samples where V rises", float(np.mean(rises)), "<=", 0.0))
    return checks


@claim(
    "20",
    "globally asymptotically stable, any lambda > 0",
    where="stability",
    quick="from 3 states at rest",
    holds_if="all converge",
    quantifier=UNIVERSAL,
)
def global_(runs: Runs) -> list[Check | Beside]:
    """Share of runs of 40 s that end within 5 % of |x0|, from 9 states (0.25, 1 and 2 times x0 at -1, 0 and 1 times
    |x0| per s; the plants are odd), with lambda 0.5, 0.8, 1 and 1.2 times the smallest of linear theory.

    Hanging pendulums need no lambda, so that there are no multiples of one; claim 24 tells of them.
    """
    starts = [(position, rate) for position in SPREAD for rate in ((0.0,) if runs.quick else RATES)]
    least = {name: smallest_lam(find_plant(name), runs.law(name, OURS).gains["k1"]) for name in PLANTS}
    cells = [(name, share) for name in PLANTS if least[name] > 0.0 for share in RATIOS]
    lams = [(name, share * least[name]) for name, share in cells]
    own = [(name, runs.law(name, OURS).gains["lam"]) for name in PLANTS]
    shares = iter(converging(runs, [*lams, *own], starts))
    return [
        *(
            check(f"{name}: share that converges at {share:g} of the smallest lambda", next(shares), ">=", 1.0)
            for name, share in cells
        ),
        *(Beside(f"{name}: smallest lambda", lam) for name, lam in least.items()),
        *(Beside(f"{name}: share at the set's lambda", next(shares)) for name in PLANTS),
    ]


def converging(runs: Runs, lams: list[tuple[str, float]], starts: list[tuple[float, float]]) -> list[float]:
    """Return the share of runs that end within CONVERGED of the plant's |x0|, for each plant and lambda."""
    grid = [long_run(runs, name, lam, position, rate) for name, lam in lams for position, rate in starts]
    near = [
        scores["ultimate_bound"] <= CONVERGED * max(map(abs, scenario.plant.x0))
        for scenario, scores in zip(grid, runs.scores(grid), strict=True)
    ]
    return np.reshape(near, (len(lams), len(starts))).mean(axis=1).tolist()


@claim(
    "21",
    "g smooth and non-zero suffices",
    where="stability",
    holds_if="converges: ultimate bound <= 5 % of |x0|",
)
def any_gain(runs: Runs) -> list[Check]:
    """Ultimate bound on the plant with the opposite input gain, -g, same law, nominal.

    The law does not know g, and so not its sign.
    """
    laws = {name: reversed_gain(runs.law(name, OURS)) for name in PLANTS}
    return comes_to_rest(runs, {name: runs.scenario(name, OURS, law=law) for name, law in laws.items()})
