"""What the stability analysis claims: V' <= -eps s^2, a V that only falls, global convergence, any g but 0."""

import numpy as np

from smc_mujoco.analysis.linear_theory import smallest_lam
from smc_mujoco.control.variants import reversed_gain
from smc_mujoco.evidence.audit.runs import Runs
from smc_mujoco.evidence.audit.verdict import Beside, Check
from smc_mujoco.evidence.papers.gaber.claims import lyapunov
from smc_mujoco.evidence.papers.gaber.claims.common import OURS, comes_to_rest, long_run
from smc_mujoco.mechanisms.plant import plant as find_plant

NEAR = 1e-6  # |s| at and below which the claim says nothing
RISE = 1e-12  # of the run's largest V: less is rounding


def decreases(runs: Runs) -> list[Check | Beside]:
    """Claim 18: Vdot <= -eps s^2 for all s != 0."""
    evidence = []
    for name in runs.plants:
        plant, gains = find_plant(name), runs.law(name, OURS).gains
        x, v = lyapunov.plane(plant, gains["k1"], points=51 if runs.quick else lyapunov.POINTS)
        states = plant, gains["lam"], gains["k1"], x, v
        rate = np.where(np.abs(lyapunov.surface(*states)) > NEAR, lyapunov.vdot(*states), -np.inf)
        worst = np.unravel_index(np.argmax(rate), rate.shape)
        evidence += [
            runs.check("share", f"{name}: share of the plane with Vdot > 0", float(np.mean(rate > 0.0))),
            Beside(f"{name}: largest Vdot", rate[worst]),
            Beside(f"{name}: largest Vdot, at x", x[worst]),
            Beside(f"{name}: largest Vdot, at v", v[worst]),
        ]
    return evidence


def monotonic(runs: Runs) -> list[Check]:
    """Claim 19: V decreases monotonically."""
    checks = []
    for trace in runs.traces([runs.scenario(name, OURS) for name in runs.plants]):
        plant, gains = trace.scenario.plant, trace.scenario.law.gains
        s = trace.v + gains["k1"] * trace.x - trace.u / lyapunov.input_gain(plant)  # alpha - u / g, u of the actuator
        height = s**2 / 2.0
        rises = np.diff(height, axis=0) > RISE * height.max()
        checks.append(runs.check("share", f"{plant.name}: fraction of samples where V rises", float(np.mean(rises))))
    return checks


def global_(runs: Runs) -> list[Check | Beside]:
    """Claim 20: globally asymptotically stable, any lambda > 0."""
    positions, rates, ratios = (runs.values[name] for name in ("positions", "rates", "ratios"))
    starts = [(position, rate) for position in positions for rate in ((0.0,) if runs.quick else rates)]
    least = {name: smallest_lam(find_plant(name), runs.law(name, OURS).gains["k1"]) for name in runs.plants}
    cells = [(name, share) for name in runs.plants if least[name] > 0.0 for share in ratios]
    lams = [(name, share * least[name]) for name, share in cells]
    own = [(name, runs.law(name, OURS).gains["lam"]) for name in runs.plants]
    shares = iter(converging(runs, [*lams, *own], starts))
    return [
        *(
            runs.check("share", f"{name}: share that converges at {share:g} of the smallest lambda", next(shares))
            for name, share in cells
        ),
        *(Beside(f"{name}: smallest lambda", lam) for name, lam in least.items()),
        *(Beside(f"{name}: share at the set's lambda", next(shares)) for name in runs.plants),
    ]


def converging(runs: Runs, lams: list[tuple[str, float]], starts: list[tuple[float, float]]) -> list[float]:
    """Return the share of runs that converge, of those of each plant and lambda."""
    grid = [long_run(runs, name, lam, position, rate) for name, lam in lams for position, rate in starts]
    near = [
        scores["ultimate_bound"] <= runs.values["within"] * max(map(abs, scenario.plant.x0))
        for scenario, scores in zip(grid, runs.scores(grid), strict=True)
    ]
    return np.reshape(near, (len(lams), len(starts))).mean(axis=1).tolist()


def any_gain(runs: Runs) -> list[Check]:
    """Claim 21: g smooth and non-zero suffices."""
    laws = {name: reversed_gain(runs.law(name, OURS)) for name in runs.plants}
    return comes_to_rest(runs, {name: runs.scenario(name, OURS, law=law) for name, law in laws.items()})
