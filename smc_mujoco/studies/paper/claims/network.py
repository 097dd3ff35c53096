"""What the paper's simulation of the network shows: five coupled pendulums.

The paper says neither which way up they are nor how strongly coupled; both networks of the study are looked at, and a
claim is supported where it holds on both.
"""

from smc_mujoco.mechanisms.plant import plant as find_plant
from smc_mujoco.studies.paper.claims.audit import claim
from smc_mujoco.studies.paper.claims.runs import HOSMC, NETWORKS, OURS, Runs, alike, scores, slower
from smc_mujoco.studies.paper.claims.verdict import Check, about, check

COUPLINGS = (0.0, 0.5, 5.0)  # N m/rad; the study's is 0.5


@claim(
    "38",
    "network: rapid synchronisation and damping",
    where="five-pendulum network",
    measured="settling time of the mean angle and of the spread, largest less smallest angle; nominal, both networks",
    holds_if="< 1 s, both",
)
def rapid(runs: Runs) -> list[Check]:
    """Times from which mean and spread stay within 2 % of |x0|."""
    got = scores(runs, NETWORKS, [OURS])
    return [
        check(f"{plant}: settling time of the {of}, s", got[plant, OURS][f"{of}_settling_time"], "<", 1.0, sentence)
        for plant in NETWORKS
        for of, sentence in (("mean", "damping"), ("spread", "synchronisation"))
    ]


@claim(
    "39",
    "network: classical slower, coupling distortion",
    where="five-pendulum network",
    measured="settling time against the paper's law; overshoot at a coupling of 0, 0.5 and 5 N m/rad; both networks",
    holds_if="slower; classical's overshoot grows with the coupling, the paper's law's does not",
)
def distortion(runs: Runs) -> list[Check]:
    """Classical law: settling time against the paper's; overshoot under three couplings, the same gains in all.

    It grows where each stronger coupling gives more than the weaker; the paper's law's does not where no coupling
    gives it more than it has without.
    """
    return [one for plant in NETWORKS for one in _distorted(runs, plant)]


def _distorted(runs: Runs, plant: str) -> list[Check]:
    laws = ("classical", OURS)
    nominal = scores(runs, [plant], laws)
    coupled = [find_plant(plant, kc=kc) for kc in COUPLINGS]
    found = runs.scores([runs.scenario(plant, law, plant=other) for law in laws for other in coupled])
    over = [s["overshoot"] for s in found]
    rival, ours = over[:3], over[3:]
    return [
        *about("slower", slower(plant, "classical", nominal)),
        *about(
            "coupling distortion",
            check(f"{plant}: overshoot of classical at 0.5 N m/rad against that at 0, %", rival[1], ">", rival[0]),
            check(f"{plant}: overshoot of classical at 5 N m/rad against that at 0.5, %", rival[2], ">", rival[1]),
            check(f"{plant}: overshoot of {OURS}, coupled, against that at 0 N m/rad, %", max(ours[1:]), "<=", ours[0]),
        ),
    ]


@claim(
    "40",
    "network: HOSMC like adaptive",
    where="five-pendulum network",
    measured="settling time of super-twisting against adaptive; nominal, both networks",
    holds_if="within 25 %",
)
def like_adaptive(runs: Runs) -> list[Check]:
    """Settling time of super-twisting against the adaptive law's."""
    got = scores(runs, NETWORKS, [HOSMC, "adaptive"])
    return [alike(plant, HOSMC, "adaptive", got, 0.25) for plant in NETWORKS]
