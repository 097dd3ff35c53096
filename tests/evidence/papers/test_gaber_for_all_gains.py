"""What is said of all gains, and of some: the inequalities at gains drawn at random, and the printed
gains in MuJoCo.
"""

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.evidence.audit.claim_runs import ClaimRuns
from smc_mujoco.evidence.audit.paper import paper
from smc_mujoco.evidence.audit.verdict import (
    NOT_AS_MEASURED,
    OURS,
    REFUTED,
    UNIVERSAL,
    Check,
    check,
    verdict,
)
from smc_mujoco.evidence.papers.gaber import lyapunov

GABER = paper("gaber")
PLANTS = GABER.claims["18"].plants
DRAWN = np.exp(np.random.default_rng(20261126).uniform(np.log(0.2), np.log(200.0), (100, 2)))


def closed_loop(plant, lam: float, k1: float, sign: float = 1.0, mass: float = 1.0):
    """Return the poles of one plant, or a synchronised network, at rest under the paper's law.

    By differences of the plant's equation, which nothing of linear_theory shares.
    """
    h = 1e-6
    plant = smc.plant(plant.name, m=mass * plant.parameters["m"]) if mass != 1.0 else plant
    ends = np.array([[h, 0.0], [-h, 0.0], [0.0, h], [0.0, -h]])
    f, g = lyapunov._model(plant, ends[:, 0], ends[:, 1])
    stiffness, damping = (f[0] - f[1]) / (2 * h), (f[2] - f[3]) / (2 * h)
    force = sign * g[0] * lam
    return np.roots([1.0, force - damping, force * k1 - stiffness])


@pytest.mark.quick
@pytest.mark.parametrize("name", PLANTS)
def test_v_rises_beside_its_line_for_every_pair(name):
    """Claim 18: on alpha = 0, V' changes sign with alpha, so it is positive on one side."""
    plant = smc.plant(name)
    for lam, k1 in DRAWN:
        x = np.linspace(0.1, 2.0, 5) * max(map(abs, plant.x0))
        rates = [lyapunov.vdot(plant, lam, k1, x, side - k1 * x) for side in (1e-4, -1e-4)]
        assert (np.maximum(*rates) > 0.0).any(), (lam, k1)


@pytest.mark.parametrize("name", PLANTS)
def test_no_pair_bears_an_input_gain_of_the_wrong_sign(name):
    """Claim 21."""
    for lam, k1 in DRAWN:
        assert closed_loop(smc.plant(name), lam, k1, sign=-1.0).real.max() > 0.0, (lam, k1)


@pytest.mark.parametrize("name", ["inverted_pendulum", "inverted_pendulum_network"])
def test_for_every_pair_a_small_lambda_and_a_heavy_mass_leave_the_top_unstable(name):
    """Claims 20 and 24: lam k1 < m grav l; claim 59: a mass above lam k1 / (grav l)."""
    plant = smc.plant(name)
    weight = plant.parameters["m"] * plant.parameters["grav"] * plant.parameters["l"]
    for lam, k1 in DRAWN:
        assert closed_loop(plant, 0.99 * weight / k1, k1).real.max() > 0.0, k1
        assert closed_loop(plant, lam, k1, mass=1.01 * lam * k1 / weight).real.max() > 0.0, (
            lam,
            k1,
        )


def test_van_der_pol_needs_a_lambda_of_1_for_every_k1():
    """Claims 20 and 24."""
    for _, k1 in DRAWN:
        assert closed_loop(smc.plant("van_der_pol"), 0.99, k1).real.max() > 0.0


PRINTED = [(id, name) for id, claim in GABER.claims.items() for name in claim.examples]


@pytest.mark.parametrize(
    ("id", "name"),
    [
        pytest.param(
            *pair, marks=[pytest.mark.slow] * (pair[0] == "61" or pair[1].endswith("work"))
        )
        for pair in PRINTED
    ],
)
def test_printed_gains_meet_their_limit_in_mujoco(id, name):
    entry = GABER.claims[id]
    runs = ClaimRuns(GABER, entry.rivals or "study", id == "11").of(entry).on(name)
    runs = runs.at(entry.searched or entry.laws[0], entry.examples[name], runs.quick)
    measured = entry.evidence(runs)
    checks = []
    if isinstance(measured, dict):
        for threshold in entry.thresholds:
            checks += threshold.evidence(measured[threshold.measure])
    else:
        checks = [check for check in measured if isinstance(check, Check)]
    assert checks
    assert [check for check in checks if not check.holds] == []


def test_each_limit_has_the_paper_s_words_or_is_ours_and_then_refutes_nothing():
    assert all(claim.limit for claim in GABER.claims.values())
    missed = [check("time", 2.0, "<=", 1.0)]
    assert verdict(missed, UNIVERSAL, limit="quoted") == REFUTED
    assert verdict(missed, UNIVERSAL, limit=OURS) == NOT_AS_MEASURED
