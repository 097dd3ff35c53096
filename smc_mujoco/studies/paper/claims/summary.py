"""What the paper's summary of its benchmarks says, on all five plants of the study, nominal."""

from smc_mujoco.studies.paper.claims.audit import claim
from smc_mujoco.studies.paper.claims.runs import HOSMC, OURS, Runs, overshoot, scores
from smc_mujoco.studies.paper.claims.verdict import UNIVERSAL, Check, check, ratio
from smc_mujoco.studies.paper.scenarios import PLANTS


@claim(
    "50",
    "fast and monotonic on every system",
    where="summary of benchmarking results",
    measured="overshoot on every plant, nominal",
    holds_if="< 1 %",
    quantifier=UNIVERSAL,
)
def monotonic(runs: Runs) -> list[Check]:
    """Overshoot of the paper's law, plant by plant; without settling there is no convergence to be monotonic."""
    got = scores(runs, PLANTS, [OURS])
    return [check(f"{plant}: overshoot, %", overshoot(got[plant, OURS]), "<", 1.0) for plant in PLANTS]


@claim(
    "51",
    "settles like or better than classical and HOSMC",
    where="summary of benchmarking results",
    measured="settling time on every plant against the better of classical and super-twisting, nominal",
    holds_if="<= 1.1x the better",
)
def settles_as_well(runs: Runs) -> list[Check]:
    """Settling time of the paper's law over the faster rival's, plant by plant."""
    got = scores(runs, PLANTS, [OURS, "classical", HOSMC])
    found = []
    for plant in PLANTS:
        ours, *rivals = (got[plant, law]["settling_time"] for law in (OURS, "classical", HOSMC))
        what = f"{plant}: settling time, over the better of classical and {HOSMC}"
        found.append(check(what, ratio(ours, min(rivals)), "<=", 1.1))
    return found


@claim(
    "52",
    "removes the chattering of classical and adaptive",
    where="summary of benchmarking results",
    measured="TV rate of u on every plant, nominal",
    holds_if="< 1 % of each",
    note="Here the paper has adaptive SMC chatter; its table I has it without chattering.",
)
def removes_chattering(runs: Runs) -> list[Check]:
    """TV rate of the paper's law over each rival's, plant by plant."""
    rivals = ("classical", "adaptive")
    got = scores(runs, PLANTS, [OURS, *rivals])
    return [
        check(
            f"{plant}: TV rate, over that of {law}",
            ratio(got[plant, OURS]["tv_rate"], got[plant, law]["tv_rate"]),
            "<",
            0.01,
        )
        for plant in PLANTS
        for law in rivals
    ]
