"""The time of a law is that of its compiled code, on what it measures in a run."""

import numpy as np
import pytest
from helpers.plants_ab import called
from helpers.python_laws import acting

import smc_mujoco as smc
from smc_mujoco.analysis import law_time
from smc_mujoco.control.law import Measurement

pytestmark = pytest.mark.quick


def test_the_law_is_given_what_it_measures_in_its_run():
    scenario = smc.Scenario(
        plant="pendulum_network",
        law=smc.law("pid"),
        model="nominal",
        velocity="filtered_difference",
        noise=smc.Noise(position=0.01),
        reference=smc.Sine(0.2, 3.0),
        duration=0.3,
    )
    law = scenario.resolved.law
    u = smc.run(scenario).u[:-1, -1]
    memory = np.zeros(law.memory)
    seen = []
    for row in law_time._measured(scenario):
        seen.append(Measurement(*row))
    commands = np.array([called(law, y, memory)[0] for y in seen])
    np.testing.assert_allclose(
        commands.clip(-seen[0].limit, seen[0].limit), u, rtol=1e-9, atol=1e-9
    )


def test_a_law_is_timed_in_the_first_seconds_of_a_run_whose_fault_comes_later(monkeypatch):
    monkeypatch.setattr(law_time, "LONGEST", 0.05)
    late = smc.Scenario(plant="duffing", law="none", fault=smc.Fault(0.1), duration=0.2)
    assert len(law_time._measured(late)) == 50


@pytest.mark.parametrize(
    "law", [acting(lambda seen: -0.1 * seen[0]), smc.law("observer_free_joint")]
)
def test_a_law_in_python_or_of_many_joints_has_none(law):
    assert (
        law_time.law_time(
            smc.Scenario(plant="panda" if law.joint else "duffing", law=law, duration=0.01)
        )
        is None
    )
