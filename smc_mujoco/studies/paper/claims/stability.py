"""What the stability analysis claims: V' <= -eps s^2, a V that only falls, global convergence, any g but 0."""

import numpy as np

from smc_mujoco.analysis.linear_theory import smallest_lam
from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.studies.paper.claims import lyapunov
from smc_mujoco.studies.paper.claims.audit import claim
from smc_mujoco.studies.paper.claims.runs import OURS, Runs, comes_to_rest
from smc_mujoco.studies.paper.claims.variants import reversed_gain, with_gains
from smc_mujoco.studies.paper.claims.verdict import UNIVERSAL, Beside, Check, check
from smc_mujoco.studies.paper.scenarios import PLANTS

NEAR = 1e-6  # |s| at and below which the claim says nothing
RISE = 1e-12  # of the run's largest V: less is rounding
RATIOS = (0.5, 0.8, 1.0, 1.2)  # lambda over the smallest that linear theory finds stable
SPREAD, RATES = (0.25, 1.0, 2.0), (-1.0, 0.0, 1.0)  # initial states: times x0; times |x0| per s
LONG, PERIOD = 40.0, 5e-3  # s; s, of control and physics
CONVERGED = 0.05  # of |x0|


@claim(
    "18",
    "Vdot <= -eps s^2 for all s != 0",
    where="stability",
    measured="sign of Vdot on a grid of the state plane, 201 x 201, |x| up to 2 |x0| and |v| up to 2 k1 |x0|, with the "
    "exact f and g of each plant and the law not saturated; a network synchronised, in which a channel is one pendulum",
    quick="51 x 51 points",
    holds_if="no point with Vdot > 0 and |s| > 1e-6",
    quantifier=UNIVERSAL,
    note="Vdot has the sign of alpha alphadot. On alpha = 0 alphadot is f(x, -k1 x) - k1^2 x whatever lambda is, so "
    "that Vdot > 0 on one side of that line wherever this is not 0.",
)
def decreases(runs: Runs) -> list[Check | Beside]:
    """The share of the plane in which Vdot > 0; beside it where it is largest, and how large."""
    found = []
    for name in PLANTS:
        plant, gains = find_plant(name), runs.law(name, OURS).gains
        x, v = lyapunov.plane(plant, gains["k1"], points=51 if runs.quick else lyapunov.POINTS)
        states = plant, gains["lam"], gains["k1"], x, v
        rate = np.where(np.abs(lyapunov.surface(*states)) > NEAR, lyapunov.vdot(*states), -np.inf)
        worst = np.unravel_index(np.argmax(rate), rate.shape)
        found += [
            check(f"{name}: share of the plane with Vdot > 0", float(np.mean(rate > 0.0)), "<=", 0.0),
            Beside(f"{name}: largest Vdot", rate[worst]),
            Beside(f"{name}: largest Vdot, at x", x[worst]),
            Beside(f"{name}: largest Vdot, at v", v[worst]),
        ]
    return found


@claim(
    "19",
    "V decreases monotonically",
    where="stability",
    measured="fraction of the control periods of the nominal run in which V, of the true state, rises by more than "
    "rounding; of all channels of a network",
    holds_if="0",
    quantifier=UNIVERSAL,
)
def monotonic(runs: Runs) -> list[Check]:
    """V = s^2 / 2, s = alpha - u / g with the u that was given; a rise is one above 1e-12 of the run's largest V."""
    found = []
    for trace in runs.traces([runs.scenario(name, OURS) for name in PLANTS]):
        plant, gains = trace.scenario.plant, trace.scenario.law.gains
        height = (trace.v + gains["k1"] * trace.x - trace.u / lyapunov.input_gain(plant)) ** 2 / 2.0
        rises = np.diff(height, axis=0) > RISE * height.max()
        found.append(check(f"{plant.name}: fraction of samples where V rises", float(np.mean(rises)), "<=", 0.0))
    return found


@claim(
    "20",
    "globally asymptotically stable, any lambda > 0",
    where="stability",
    measured="share of runs of 40 s that end within 5 % of |x0|, from 9 states (0.25, 1 and 2 times x0 at -1, 0 and 1 "
    "times |x0| per s; the plants are odd), with lambda 0.5, 0.8, 1 and 1.2 times the smallest of linear theory",
    quick="from 3 states at rest",
    holds_if="all converge",
    quantifier=UNIVERSAL,
    note="Hanging pendulums need no lambda, so that there are no multiples of one; claim 24 tells of them.",
)
def global_(runs: Runs) -> list[Check | Beside]:
    """Share of the initial states from which the run converges, for every plant and ratio.

    Beside them the same with the lambda of the set.
    """
    starts = [(a, b) for a in SPREAD for b in RATES]
    starts = starts[1::3] if runs.quick else starts  # those at rest
    cells = [(name, share) for name in PLANTS if limit(runs, name) > 0.0 for share in RATIOS]
    lams = [(name, share * limit(runs, name)) for name, share in cells]
    own = [(name, runs.law(name, OURS).gains["lam"]) for name in PLANTS]
    shares = converging(runs, [*lams, *own], starts)
    told = [f"{name}: share that converges at {share:g} of the smallest lambda" for name, share in cells]
    return [
        *(check(what, share, ">=", 1.0) for what, share in zip(told, shares, strict=False)),
        *(Beside(f"{name}: smallest lambda", limit(runs, name)) for name in PLANTS),
        *(
            Beside(f"{name}: share at the set's lambda", share)
            for name, share in zip(PLANTS, shares[len(cells) :], strict=True)
        ),
    ]


def converging(runs: Runs, lams: list[tuple[str, float]], starts: list[tuple[float, float]]) -> list[float]:
    """Return the share of runs that end within CONVERGED of the plant's |x0|, for each plant and lambda."""
    grid = [_from(runs, name, lam, position, rate) for name, lam in lams for position, rate in starts]
    near = [
        scores["ultimate_bound"] <= CONVERGED * max(map(abs, scenario.plant.x0))
        for scenario, scores in zip(grid, runs.scores(grid), strict=True)
    ]
    return np.reshape(near, (len(lams), len(starts))).mean(axis=1).tolist()


def limit(runs: Runs, name: str) -> float:
    """Return the smallest lambda that linear theory finds stable at the k1 of the set; 0 if any is."""
    return smallest_lam(find_plant(name), runs.law(name, OURS).gains["k1"])


def _from(runs: Runs, name: str, lam: float, position: float, rate: float) -> Scenario:
    """Return a long run from position times x0, with every channel at rate times |x0| per s."""
    x0 = find_plant(name).x0
    return runs.scenario(
        name,
        OURS,
        law=with_gains(runs.law(name, OURS), lam=lam),
        x0=[position * x for x in x0],
        v0=rate * max(map(abs, x0)),
        duration=LONG,
        control_period=PERIOD,
        physics_step=PERIOD,
    )


@claim(
    "21",
    "g smooth and non-zero suffices",
    where="stability",
    measured="ultimate bound on the plant with the opposite input gain, -g, same law, nominal",
    holds_if="converges: ultimate bound <= 5 % of |x0|",
    note="The law does not know g, and so not its sign.",
)
def any_gain(runs: Runs) -> list[Check]:
    """Largest |x| in the last 20 % of the run over |x0|; inf where the run diverges."""
    laws = {name: reversed_gain(runs.law(name, OURS)) for name in PLANTS}
    return comes_to_rest(runs, {name: runs.scenario(name, OURS, law=law) for name, law in laws.items()})
