"""What the list of contributions claims: no chattering by construction, smoother, coordinated, simple."""

from smc_mujoco.analysis.linear_theory import critical_delay
from smc_mujoco.control.law import law as find_law
from smc_mujoco.control.variants import squeezed
from smc_mujoco.evidence.audit.runs import Runs
from smc_mujoco.evidence.audit.verdict import Beside, Check, ratio
from smc_mujoco.evidence.papers.gaber.claims.common import (
    CONDITIONED,
    OURS,
    RIVALS,
    UNCLAMPED,
    command_bound,
    deviation,
)
from smc_mujoco.evidence.papers.gaber.claims.timing import nanoseconds
from smc_mujoco.mechanisms.plant import plant as find_plant

MEASURES = (  # sentence, name, metric, condition
    ("smoothness", "TV rate", "tv_rate", "nominal"),
    ("robustness", "steady error under d", "steady_error", "constant"),
)
GENERAL = ("classical", "adaptive", "super_twisting", CONDITIONED, "boundary_layer")


def compensates(runs: Runs) -> list[Check]:
    """Claim 10: compensates input nonlinearity implicitly."""
    checks = []
    for plant in runs.plants:
        law = runs.law(plant, OURS)
        own, bent = runs.traces([runs.scenario(plant, OURS, law=one) for one in (law, squeezed(law))])
        checks.append(runs.check("deviation", f"{plant}: max |x - x'| / |x0|", deviation(own, bent)))
    return checks


def never_chatters(runs: Runs) -> list[Check | Beside]:
    """Claim 11: no chattering by construction."""
    periods, delays, shortest = (runs.values[name] for name in ("periods", "delays", "shortest"))
    ends = delays[0], delays[-1]
    cells = [(period, delay) for period in periods for delay in delays]
    cells += [(shortest, delay) for delay in ends]  # ten times the steps, so with the ends of the delays alone
    if runs.quick:
        cells = [(period, delay) for period in (periods[0], periods[-1]) for delay in ends]
    evidence = []
    for plant in runs.plants:
        scores = runs.scores(
            runs.scenario(plant, OURS, control_period=period * 1e-3, input_delay=delay * 1e-3)
            for period, delay in cells
        )
        rates = [ratio(each["tv_rate"], command_bound(runs, plant)) for each in scores]
        rate, (period, delay) = max(zip(rates, cells, strict=True))
        gains = runs.law(plant, OURS).gains
        limit = critical_delay(find_plant(plant), gains["lam"], gains["k1"], control_period=1e-3)
        evidence += [
            runs.check("TV rate", f"{plant}: largest TV rate / min(lambda, u_max), 1/s", rate),
            Beside(f"{plant}: that is at a control period of, ms", float(period)),
            Beside(f"{plant}: and a delay of, ms", float(delay)),
            Beside(f"{plant}: delay from which the loop is unstable at 1 ms, linear theory, ms", 1e3 * limit),
        ]
    return evidence


def better(runs: Runs) -> list[Check | Beside]:
    """Claim 12: better smoothness and robustness than the alternatives."""
    checks, beside = [], []
    for plant in runs.plants:
        for sentence, name, metric, condition in MEASURES:
            values = {law: runs.score(plant, law, condition)[metric] for law in (OURS, *RIVALS, CONDITIONED, UNCLAMPED)}
            for law in RIVALS:
                what = f"{plant}: {name} against 1.1 times that of {law}"
                checks.append(runs.check(sentence, what, values[OURS], values[law], sentence))
            beside += [Beside(f"{plant}: {name} of {law}", values[law]) for law in (CONDITIONED, UNCLAMPED)]
    return checks + beside


def synchronises(runs: Runs) -> list[Check]:
    """Claim 13: synchronisation without coordination."""
    checks = []
    for plant in runs.plants:
        scores = runs.scores(runs.scenario(plant, OURS, condition) for condition in runs.conditions)
        joined, alone = (each["spread_settling_time"] for each in scores)
        checks += [
            runs.check("settling time, s", f"{plant}: settling time of the spread, s", joined),
            runs.check(
                "without coupling", f"{plant}: the same without coupling, s, against that with it", alone, joined
            ),
        ]
    return checks


def simple(runs: Runs) -> list[Check | Beside]:
    """Claim 14: low complexity."""
    spent = nanoseconds({name: runs.mutated(find_law(name)) for name in (OURS, *GENERAL)}, quick=runs.quick)
    others = {name: ratio(spent[OURS], spent[name]) for name in GENERAL}
    beside = [Beside(f"time per sample / that of {name}", value) for name, value in others.items()]
    return [runs.check("time", "time per sample / that of the fastest other law", max(others.values())), *beside]
