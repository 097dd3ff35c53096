"""What the paper's simulations of single plants show: pendulum, Van der Pol and Duffing, four laws side by side.

Settling time, overshoot and ripple are those of `metrics`; overshoot is what goes beyond the origin, in percent of
|x0|, whether the paper calls it overshoot or undershoot, and where
less is better it is inf of a run that does not settle. "Slower" is a larger settling time; "larger" and "slower" are so
by more than the least relevant difference, see `differences`.
"""

from smc_mujoco.studies.paper.claims.audit import claim
from smc_mujoco.studies.paper.claims.runs import (
    HOSMC,
    OURS,
    RIVALS,
    UNCLAMPED,
    Runs,
    ScoresOfPairs,
    alike,
    larger_than,
    overshoot,
    scores,
    slower,
)
from smc_mujoco.studies.paper.claims.verdict import Beside, Check, about, check
from smc_mujoco.studies.paper.scenarios import LAWS

PENDULUM, VAN_DER_POL, DUFFING = "inverted_pendulum", "van_der_pol", "duffing"
CONDITIONED = "conditioned_super_twisting"
MODERATE = (2.0, 15.0)  # %


@claim(
    "27",
    "pendulum: like adaptive, minimal overshoot",
    where="inverted pendulum",
    measured="settling time against adaptive, overshoot; nominal",
    holds_if="within 25 % of adaptive's, and < 1 %",
)
def like_adaptive(runs: Runs) -> list[Check]:
    """Settling time of the paper's law against the adaptive one's, and its overshoot."""
    got = scores(runs, [PENDULUM], [OURS, "adaptive"])
    return [
        *about("like adaptive", alike(PENDULUM, OURS, "adaptive", got, 0.25)),
        *about("minimal overshoot", _overshoot(PENDULUM, OURS, got, "<", 1.0)),
    ]


@claim(
    "28",
    "pendulum: classical slower, fluctuates",
    where="inverted pendulum",
    measured="settling time against the paper's law; peak-to-peak x in the last 20 % of the run; nominal",
    holds_if="slower, and > 1e-3 of |x0|",
)
def classical_fluctuates(runs: Runs) -> list[Check]:
    """Classical law: settling time against the paper's law, and ripple over |x0|."""
    got = scores(runs, [PENDULUM], [OURS, "classical"])
    start = abs(runs.scenario(PENDULUM, "classical").x0[0])
    ripple = got[PENDULUM, "classical"]["ripple"] / start
    return [
        *about("slower", slower(PENDULUM, "classical", got)),
        check(f"{PENDULUM}: ripple of classical over |x0|", ripple, ">", 1e-3, "fluctuates"),
    ]


@claim(
    "29",
    "pendulum: HOSMC fast, larger undershoot",
    where="inverted pendulum",
    measured="overshoot against the paper's law, nominal",
    holds_if="larger than the paper's law's",
)
def larger_undershoot(runs: Runs) -> list[Check]:
    """Overshoot of super-twisting against the paper's law."""
    return [_above(PENDULUM, HOSMC, OURS, scores(runs, [PENDULUM], [OURS, HOSMC]))]


@claim(
    "31",
    "Van der Pol: moderate undershoot",
    where="Van der Pol oscillator",
    measured="overshoot, nominal, as its distance from that range",
    holds_if="2 to 15 %",
)
def moderate_undershoot(runs: Runs) -> list[Check | Beside]:
    """Distance of the overshoot from the range, as one check: every number would meet one of the range's ends."""
    over = overshoot(scores(runs, [VAN_DER_POL], [OURS])[VAN_DER_POL, OURS])
    outside = max(MODERATE[0] - over, over - MODERATE[1], 0.0)
    return [
        check(f"{VAN_DER_POL}: overshoot of {OURS}, percentage points outside 2 to 15 %", outside, "<=", 0.0),
        Beside(f"{VAN_DER_POL}: overshoot of {OURS}, %", over),
    ]


@claim(
    "32",
    "Van der Pol: HOSMC largest oscillation",
    where="Van der Pol oscillator",
    measured="overshoot of super-twisting against the largest of the other three; the same of the conditioned law",
    holds_if="largest, by the least relevant difference",
    note="Where plain super-twisting meets the actuator's bound its integral winds up, and the swing measures that "
    "rather than the method; conditioned super-twisting, the same law without wind-up, stands beside it, and only "
    "if both are the largest is the claim supported. In the first gains the integral of super-twisting is clamped at "
    "the actuator's bound, as when they were found; the law as published stands beside. Largest is larger than all "
    "others by 3 % of it and by 0.5 % of |x0|.",
)
def largest_oscillation(runs: Runs) -> list[Check | Beside]:
    """Overshoot of super-twisting, plain and conditioned, against the largest of the paper's three other laws."""
    got = scores(runs, [VAN_DER_POL], [*LAWS, CONDITIONED, UNCLAMPED])
    others = larger_than(max(overshoot(got[VAN_DER_POL, law]) for law in LAWS if law != HOSMC), of=100.0)
    return [
        *(_overshoot(VAN_DER_POL, law, got, ">", others) for law in (HOSMC, CONDITIONED)),
        Beside(f"{VAN_DER_POL}: overshoot of {UNCLAMPED}, %", got[VAN_DER_POL, UNCLAMPED]["overshoot"]),
    ]


@claim(
    "33",
    "Van der Pol: adaptive overshoots more",
    where="Van der Pol oscillator",
    measured="overshoot against the paper's law, nominal",
    holds_if="larger than the paper's law's",
)
def adaptive_overshoots(runs: Runs) -> list[Check]:
    """Overshoot of the adaptive law against the paper's law."""
    return [_above(VAN_DER_POL, "adaptive", OURS, scores(runs, [VAN_DER_POL], [OURS, "adaptive"]))]


@claim(
    "34",
    "Van der Pol: classical slower, no overshoot",
    where="Van der Pol oscillator",
    measured="settling time against the paper's law, overshoot; nominal",
    holds_if="slower, and < 1 %",
)
def classical_slower(runs: Runs) -> list[Check]:
    """Classical law: settling time against the paper's law, and overshoot."""
    got = scores(runs, [VAN_DER_POL], [OURS, "classical"])
    return [
        *about("slower", slower(VAN_DER_POL, "classical", got)),
        *about("no overshoot", _overshoot(VAN_DER_POL, "classical", got, "<", 1.0)),
    ]


@claim(
    "35",
    "Duffing: fast, minimal overshoot",
    where="Duffing oscillator",
    measured="settling time and overshoot against the best of the three other laws, nominal",
    holds_if="first or within 10 % of first, in both",
    note="Where a rival does not overshoot at all, within 10 % of first is not to overshoot either.",
)
def fast_and_minimal(runs: Runs) -> list[Check]:
    """Settling time and overshoot of the paper's law over the best rival's: first is below 1, near it at most 1.1."""
    got = scores(runs, [DUFFING], LAWS)
    times = {law: got[DUFFING, law]["settling_time"] for law in LAWS}
    overs = {law: overshoot(got[DUFFING, law]) for law in LAWS}
    return [
        check(f"{DUFFING}: {name} of {OURS} against 1.1 of the best rival's", of[OURS], "<=", 1.1 * best, sentence)
        for sentence, name, of in (
            ("fast", "settling time, s,", times),
            ("minimal overshoot", "overshoot, %,", overs),
        )
        for best in [min(of[law] for law in RIVALS)]
    ]


@claim(
    "36",
    "Duffing: adaptive and HOSMC similar",
    where="Duffing oscillator",
    measured="settling time against the paper's law, nominal",
    holds_if="within 25 % of the paper's law's, both",
    note="The paper's sentence likens them to its own law; read as like each other, the number beside would decide.",
)
def similar(runs: Runs) -> list[Check | Beside]:
    """Settling times of the adaptive law and super-twisting against the paper's law, to which the paper likens them."""
    got = scores(runs, [DUFFING], [OURS, "adaptive", HOSMC])
    each = alike(DUFFING, HOSMC, "adaptive", got, 0.25)
    return [*(alike(DUFFING, law, OURS, got, 0.25) for law in ("adaptive", HOSMC)), Beside(each.what, each.value)]


@claim(
    "37",
    "Duffing: classical slower, larger deviation",
    where="Duffing oscillator",
    measured="settling time and overshoot against the paper's law, nominal",
    holds_if="both larger than the paper's law's",
)
def classical_deviates(runs: Runs) -> list[Check]:
    """Classical law against the paper's: settling time and overshoot."""
    got = scores(runs, [DUFFING], [OURS, "classical"])
    return [
        *about("slower", slower(DUFFING, "classical", got)),
        *about("larger deviation", _above(DUFFING, "classical", OURS, got)),
    ]


def _overshoot(plant: str, law: str, got: ScoresOfPairs, relation: str, limit: float) -> Check:
    """Check a law's overshoot against a limit; to stay below a limit it must settle."""
    value = overshoot(got[plant, law]) if relation in ("<", "<=") else got[plant, law]["overshoot"]
    return check(f"{plant}: overshoot of {law}, %", value, relation, limit)


def _above(plant: str, law: str, other: str, got: ScoresOfPairs) -> Check:
    """Check that a law's overshoot is larger, by a relevant difference, than another's, which must settle."""
    limit = larger_than(overshoot(got[plant, other]), of=100.0)
    return check(f"{plant}: overshoot of {law} against {other}'s, %", got[plant, law]["overshoot"], ">", limit)
