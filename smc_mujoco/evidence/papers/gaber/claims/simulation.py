"""What the paper's simulations show: four laws side by side on single plants and on the network, and its summary.

Settling time, overshoot and ripple are those of `metrics`. Overshoot is what goes beyond the origin, in percent of
|x0|, whether the paper calls it overshoot or undershoot; if less is better, it is inf of a run that does not settle.
"Slower" is a larger settling time; "larger" and "slower" mean by more than the least relevant difference, see
`differences`. The paper says neither which way up the network's pendulums are nor how strongly they are coupled: a
claim on it is supported if it holds on both networks of the study.
"""

from smc_mujoco.evidence.audit.runs import Runs
from smc_mujoco.evidence.audit.verdict import Beside, Check, ratio
from smc_mujoco.evidence.papers.gaber.claims.common import (
    CONDITIONED,
    HOSMC,
    OURS,
    UNCLAMPED,
    alike,
    larger_than,
    overshoot,
    scale,
    slower,
)
from smc_mujoco.evidence.papers.gaber.scenarios import LAWS
from smc_mujoco.mechanisms.plant import plant as find_plant

PENDULUM, VAN_DER_POL, DUFFING = "inverted_pendulum", "van_der_pol", "duffing"


def overshoots_little(runs: Runs, plant: str, law: str) -> Check:
    """Check the overshoot of a law, %, which must settle."""
    return runs.check("overshoot, %", f"{plant}: overshoot of {law}, %", overshoot(runs, plant, law))


def overshoots_more(runs: Runs, plant: str, law: str) -> Check:
    """Check that a law's overshoot is larger than that of the paper's law, which must settle."""
    limit = larger_than(overshoot(runs, plant, OURS), of=100.0)
    what = f"{plant}: overshoot of {law} against {OURS}'s, %"
    return runs.check("overshoot", what, runs.score(plant, law)["overshoot"], limit)


def pendulum_like_adaptive(runs: Runs) -> list[Check]:
    """Claim 27: pendulum: like adaptive, minimal overshoot."""
    return [
        alike(runs, runs.plant, OURS, "adaptive"),
        overshoots_little(runs, runs.plant, OURS),
    ]


def classical_fluctuates(runs: Runs) -> list[Check]:
    """Claim 28: pendulum: classical slower, fluctuates."""
    ripple = runs.score(runs.plant, "classical")["ripple"] / scale(runs.scenario(runs.plant, "classical"))
    return [
        slower(runs, runs.plant, "classical"),
        runs.check("ripple", f"{runs.plant}: ripple of classical over |x0|", ripple),
    ]


def larger_undershoot(runs: Runs) -> list[Check]:
    """Claim 29: pendulum: HOSMC fast, larger undershoot."""
    return [overshoots_more(runs, runs.plant, HOSMC)]


def moderate_undershoot(runs: Runs) -> list[Check | Beside]:
    """Claim 31: Van der Pol: moderate undershoot."""
    over = overshoot(runs, runs.plant, OURS)
    asked = runs.thresholds["overshoot, %"]
    what = f"{runs.plant}: overshoot of {OURS}, percentage points outside {asked.text} %"
    return [
        runs.check("overshoot, %", what, asked.distance(over)),  # one check: every number meets one end of the range
        Beside(f"{runs.plant}: overshoot of {OURS}, %", over),
    ]


def largest_oscillation(runs: Runs) -> list[Check | Beside]:
    """Claim 32: Van der Pol: HOSMC largest oscillation."""
    others = larger_than(max(overshoot(runs, runs.plant, law) for law in LAWS if law != HOSMC), of=100.0)
    over = {law: runs.score(runs.plant, law)["overshoot"] for law in (HOSMC, CONDITIONED, UNCLAMPED)}
    return [
        *(
            runs.check("overshoot", f"{runs.plant}: overshoot of {law}, %", over[law], others)
            for law in (HOSMC, CONDITIONED)
        ),
        Beside(f"{runs.plant}: overshoot of {UNCLAMPED}, %", over[UNCLAMPED]),
    ]


def adaptive_overshoots(runs: Runs) -> list[Check]:
    """Claim 33: Van der Pol: adaptive overshoots more."""
    return [overshoots_more(runs, runs.plant, "adaptive")]


def classical_slower(runs: Runs) -> list[Check]:
    """Claim 34: Van der Pol: classical slower, no overshoot."""
    return [
        slower(runs, runs.plant, "classical"),
        overshoots_little(runs, runs.plant, "classical"),
    ]


def fast_and_minimal(runs: Runs) -> list[Check]:
    """Claim 35: Duffing: fast, minimal overshoot."""
    ours, *times = (runs.score(runs.plant, law)["settling_time"] for law in LAWS)
    over, *overs = (overshoot(runs, runs.plant, law) for law in LAWS)
    what = f"{runs.plant}: {{}} of {OURS} against 1.1 of the best rival's"
    return [
        runs.check("settling time", what.format("settling time, s,"), ours, min(times)),
        runs.check("overshoot", what.format("overshoot, %,"), over, min(overs)),
    ]


def similar(runs: Runs) -> list[Check | Beside]:
    """Claim 36: Duffing: adaptive and HOSMC similar."""
    each = alike(runs, runs.plant, HOSMC, "adaptive")
    return [*(alike(runs, runs.plant, law, OURS) for law in ("adaptive", HOSMC)), Beside(each.what, each.value)]


def classical_deviates(runs: Runs) -> list[Check]:
    """Claim 37: Duffing: classical slower, larger deviation."""
    return [
        slower(runs, runs.plant, "classical"),
        overshoots_more(runs, runs.plant, "classical"),
    ]


def rapid(runs: Runs) -> list[Check]:
    """Claim 38: network: rapid synchronisation and damping."""
    return [
        runs.check(of, f"{plant}: settling time of the {of}, s", runs.score(plant, OURS)[f"{of}_settling_time"])
        for plant in runs.plants
        for of in ("mean", "spread")
    ]


def distortion(runs: Runs) -> list[Check]:
    """Claim 39: network: classical slower, coupling distortion."""
    checks = []
    for plant in runs.plants:
        coupled = [find_plant(plant, kc=kc) for kc in runs.values["couplings"]]  # the same gains in all
        scores = runs.scores(runs.scenario(plant, law, plant=one) for law in ("classical", OURS) for one in coupled)
        over = [each["overshoot"] for each in scores]
        what, classical, ours = f"{plant}: overshoot of", "overshoot of classical", "overshoot of the paper's law"
        checks += [
            slower(runs, plant, "classical"),
            runs.check(classical, f"{what} classical at 0.5 N m/rad against that at 0, %", over[1], over[0]),
            runs.check(classical, f"{what} classical at 5 N m/rad against that at 0.5, %", over[2], over[1]),
            runs.check(ours, f"{what} {OURS}, coupled, against that at 0 N m/rad, %", max(over[4:]), over[3]),
        ]
    return checks


def hosmc_like_adaptive(runs: Runs) -> list[Check]:
    """Claim 40: network: HOSMC like adaptive."""
    return [alike(runs, plant, HOSMC, "adaptive") for plant in runs.plants]


def monotonic(runs: Runs) -> list[Check]:
    """Claim 50: fast and monotonic on every system."""
    return [runs.check("overshoot, %", f"{plant}: overshoot, %", overshoot(runs, plant, OURS)) for plant in runs.plants]


def settles_as_well(runs: Runs) -> list[Check]:
    """Claim 51: settles like or better than classical and HOSMC."""
    checks = []
    for plant in runs.plants:
        ours, *rivals = (runs.score(plant, law)["settling_time"] for law in (OURS, "classical", HOSMC))
        what = f"{plant}: settling time, over the better of classical and {HOSMC}"
        checks.append(runs.check("settling time", what, ratio(ours, min(rivals))))
    return checks


def removes_chattering(runs: Runs) -> list[Check]:
    """Claim 52: removes the chattering of classical and adaptive."""
    checks = []
    for plant in runs.plants:
        for law in ("classical", "adaptive"):
            ours, rival = (runs.score(plant, name)["tv_rate"] for name in (OURS, law))
            checks.append(runs.check("TV rate", f"{plant}: TV rate, over that of {law}", ratio(ours, rival)))
    return checks
