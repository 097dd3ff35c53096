"""Batches hold every run once, and do not change what is found."""

import pytest
from helpers.runs import fails_late

import smc_mujoco as smc
from smc_mujoco.simulation.grid import grid
from smc_mujoco.studies import batches


def mixed() -> list[smc.Scenario]:
    return grid(
        ["duffing", "pendulum_network"],
        ["classical", "none"],
        ["nominal", "coulomb"],
        3,
        "study",
        0.05,
    )


@pytest.mark.parametrize("steps", [1, 200, 10**9])
def test_batches_hold_every_scenario_once_and_agree_on_its_layout(monkeypatch, steps):
    monkeypatch.setattr(batches, "MAX_WORK", steps)
    scenarios = mixed()
    batches_of_runs = list(batches.batches(scenarios))
    assert sorted(map(id, scenarios)) == sorted(
        id(trace.scenario) for batch in batches_of_runs for trace in batch
    )
    for batch in [[trace.scenario for trace in batch] for batch in batches_of_runs]:
        assert (
            len({(s.plant.name, s.resolved.integrator, s.resolved.physics_step) for s in batch})
            == 1
        )
        assert len(batch) == 1 or sum(s.work for s in batch) <= steps


def test_outcomes_come_in_the_order_of_the_batch_and_do_not_depend_on_it():
    batch = []
    for w in (1.0, 0.01, 0.02):
        batch.append(smc.Scenario(plant="duffing", law=fails_late(when=w), duration=0.05))
    together = []
    for trace in batches.run_batch(batch, 2):
        together.append(batches.result_columns(trace))
    assert together == [
        batches.result_columns(trace) for s in batch for trace in batches.run_batch([s], 1)
    ]
    assert [outcome["diverged_at"] for outcome in together] == [None, 0.011, 0.021]


def test_a_batch_is_finished_while_the_next_one_runs_and_what_that_raises_is_heard():
    batches_of_runs = list(batches.batches(mixed()))
    finished = []
    batches.compute(
        batches_of_runs,
        1,
        lambda batch, traces: finished.append((batch, [t.scenario for t in traces])),
    )
    assert [batch for batch, _ in finished] == batches_of_runs
    assert [[trace.scenario for trace in batch] for batch in batches_of_runs] == [
        done for _, done in finished
    ]

    for doomed in (batches_of_runs[0], batches_of_runs[-1]):

        def full(batch, traces, doomed=doomed):
            if batch is doomed:
                raise smc.ScenarioError("no room")

        with pytest.raises(smc.ScenarioError, match="no room"):
            batches.compute(batches_of_runs, 1, full)


@pytest.mark.quick
def test_a_batch_has_as_many_runs_as_its_work_and_the_greatest_number_allow(monkeypatch):
    scenarios = grid(["duffing"], ["none"], ["nominal"], 5, "study", 0.05)
    monkeypatch.setattr(batches, "MAX_RUNS", 2)
    assert [len(batch) for batch in batches.batches(scenarios)] == [2, 2, 1]
    monkeypatch.setattr(batches, "MAX_WORK", 1)
    assert [len(batch) for batch in batches.batches(scenarios)] == [1] * 5
