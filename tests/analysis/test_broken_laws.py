"""A law that raises is told as broken, not only as one that does not converge, tolerates nothing or
fails.
"""

import pytest

import smc_mujoco as smc
from smc_mujoco.robustness.region_of_attraction import basin_of


@smc.law_function(gains={"k": 1.0})
def late(y, gains, memory):
    if y.t > 0.2:
        raise ValueError("too late")
    return -gains.k * y.e, y.e


QUESTIONS = {
    "basin": lambda law: basin_of(
        smc.Scenario(
            plant="duffing",
            law=law,
            duration=2.0,
            integrator="implicitfast",
        ),
        [0.0, 1.0],
        [0.0],
    ),
    "margins": lambda law: smc.margins("duffing", law, kinds="delay", quick=True),
    "worst_case": lambda law: smc.worst_case(
        smc.Scenario(plant="duffing", law=law, duration=1.0),
        within=smc.Uncertainty(disturbance=1.0),
        budget=2,
    ),
}


@pytest.mark.parametrize("ask", QUESTIONS.values(), ids=QUESTIONS)
def test_a_law_that_raises_is_told_once(ask):
    with pytest.warns(
        smc.errors.ScenarioWarning, match=r"^a run of late failed by itself: .*too late"
    ) as reported:
        ask(late)
    assert len(reported) == 1


@pytest.mark.quick
def test_a_plant_that_diverges_is_no_broken_law():
    trace = smc.run(
        smc.Scenario(
            plant="duffing",
            law="none",
            x0=1e5,
            duration=1.0,
        )
    )
    assert (trace.plant_diverged, trace.broken) == (True, "")
