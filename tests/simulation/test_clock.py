"""The controller's clock: late and missed samples, against plain sums and the oracle."""

import dataclasses
import math

import numpy as np
import pytest
from helpers import reference
from helpers.runs import assert_same, at_defaults

import smc_mujoco as smc
from smc_mujoco.robustness import margins
from smc_mujoco.simulation.conditions import find_condition

PERIOD, STEPS = 0.01, 10  # s, and physics steps in it


@smc.law_function
def telling_time(y, gains, memory):
    """A command that says when the law ran."""
    return y.t, y.x


@smc.law_function
def failing_at_half_a_second(y, gains, memory):
    """A law that raises."""
    if y.t > 0.5:
        raise ValueError("late")
    return 0.0, 0.0


def scenario(clock, **fields):
    """A run of 4 s whose command is the time at which the law ran."""
    steps = {
        "control_period": PERIOD,
        "physics_step": PERIOD / STEPS,
        "duration": 4.0,
        "u_max": math.inf,
    }
    return smc.Scenario(
        plant="duffing",
        law=telling_time(),
        clock=clock,
        seed=5,
        **(steps | fields),
    )


def late(trace):
    """By how many physics steps the command of each sample came late."""
    return (trace.u[:, 0] - trace.t) / (PERIOD / STEPS)


def test_every_delay_up_to_the_jitter_is_equally_probable_and_whole():
    steps = late(smc.run(scenario(smc.Clock(jitter=0.7 * PERIOD), duration=40.0)))
    assert np.abs(steps - np.round(steps)).max() < 1e-6
    counts = np.bincount(np.round(steps).astype(int), minlength=8)
    expected = len(steps) / 8
    assert len(counts) == 8
    assert np.sum((counts - expected) ** 2 / expected) < 24.3  # chi-square of 7 degrees, 0.1 %


def test_as_many_samples_are_missed_as_asked_and_hold_the_command_before():
    trace = smc.run(scenario(smc.Clock(missed=0.3), duration=40.0))
    missed = late(trace) < -0.5
    assert missed.mean() == pytest.approx(0.3, abs=3.3 * math.sqrt(0.3 * 0.7 / len(missed)))
    assert (trace.u[1:][missed[1:]] == trace.u[:-1][missed[1:]]).all()
    assert (trace.s[1:][missed[1:]] == trace.s[:-1][missed[1:]]).all()


def test_a_pause_makes_all_later_samples_later_and_covers_some():
    """The times at which the law runs are those of a loop that waits for a period, and has a pause
    of 1.3 of them.
    """
    clock = smc.Clock(pause=1.3 * PERIOD, pause_every=7.0 * PERIOD)
    compiled = smc.run(scenario(clock))
    ran = np.round(np.unique(compiled.u[1:-1, 0]) / (PERIOD / STEPS)).astype(int)
    gaps = np.diff(ran)
    paused = np.flatnonzero(gaps == 23)
    assert set(gaps) == {10, 23}
    assert set(np.diff(paused)) == {7}
    assert paused[0] < 7
    assert_same(compiled, reference.run(scenario(clock)))
    delayed = scenario(clock, input_delay=0.007, duration=0.2)
    assert_same(smc.run(delayed), reference.run(delayed))
    # of one step: covers few samples
    short = scenario(smc.Clock(pause=PERIOD / STEPS, pause_every=7.0 * PERIOD))
    assert_same(compiled := smc.run(short), reference.run(short))
    assert 3 <= (late(compiled) < -0.5).sum() <= 8
    seeds = []
    for i in range(20):
        seeds.append(dataclasses.replace(scenario(clock, duration=0.1), seed=i))
    firsts = set()
    for trace in smc.run(seeds):
        firsts.add(int(np.argmax(np.diff(np.unique(trace.u[1:-1, 0])) > 0.02)))
    assert len(firsts) > 3  # the first depends on the seed
    with pytest.raises(smc.ScenarioError, match=r"jitter 0\.001 and pause 0\.01"):
        smc.Clock(jitter=1e-3, pause=1e-2)


@pytest.mark.quick
@pytest.mark.parametrize("delay", [0, 3, 14])
def test_a_command_acts_from_its_own_time_on(delay):
    """The mean force of a period is the sum of the commands in it, each from its late sample plus
    the delay on.
    """
    trace = smc.run(
        scenario(smc.Clock(jitter=0.9 * PERIOD, missed=0.2), input_delay=delay * PERIOD / STEPS)
    )
    u = trace.u[:, 0]
    acting = np.zeros((len(trace.t) - 1) * STEPS)
    for sample, start in zip(
        u, np.round((trace.t + late(trace) * PERIOD / STEPS) / PERIOD * STEPS), strict=True
    ):
        acting[int(start) + delay :] = sample
    assert np.allclose(acting.reshape(-1, STEPS).mean(axis=1), trace.force[1:, 0], atol=1e-12)


def test_first_and_last_samples_are_on_time():
    steps = late(smc.run(scenario(smc.Clock(jitter=0.9 * PERIOD, missed=0.9))))
    assert steps[0] == pytest.approx(0.0, abs=1e-6)
    assert steps[-1] == pytest.approx(0.0, abs=1e-6)


def test_a_longer_run_begins_like_a_shorter_one():
    clock = smc.Clock(jitter=0.9 * PERIOD, missed=0.2)
    short, long = smc.run([scenario(clock, duration=1.0), scenario(clock, duration=2.0)])
    assert np.array_equal(short.u[:-1], long.u[: len(short.u) - 1])


FIELDS = {
    "jitter": {"clock": smc.Clock(jitter=5e-4)},
    "missed": {"clock": smc.Clock(missed=0.3), "input_delay": 3e-3},
    "all": {
        "clock": smc.Clock(jitter=9e-4, missed=0.3),
        "physics_step": 2.5e-4,
        "input_delay": 2.25e-3,
        "sensor": smc.Encoder(4096, period=1.25e-3, delay=5e-4, dropout=0.2),
        "noise": smc.Noise(0.01, 0.05),
        "actuator": smc.Lag(0.01),
    },
}


@pytest.mark.parametrize(
    ("plant", "name"),
    [
        ("pendulum_network", "jitter"),
        ("cart_pole", "missed"),
        ("double_pendulum", "all"),
    ],
)
def test_callback_equals_plain_loop(plant, name):
    if plant == "cart_pole":
        law = "hierarchical"
    else:
        law = "super_twisting"
    scenario = smc.Scenario(
        plant=plant,
        law=at_defaults(law),
        duration=0.2,
        seed=3,
        **FIELDS[name],
    )
    assert_same(smc.run(scenario), reference.run(scenario))


def test_a_law_that_raises_late_ends_the_run_with_its_own_reason():
    late_scenario = dataclasses.replace(
        scenario(smc.Clock(jitter=0.9 * PERIOD)), law=failing_at_half_a_second()
    )
    trace = smc.run(late_scenario)
    assert trace.failure is not None
    assert "late" in trace.failure
    assert_same(trace, reference.run(late_scenario))


def test_a_clock_comes_back_from_a_file_and_from_text(tmp_path):
    trace = smc.run(scenario(smc.Clock(jitter=0.003, missed=0.1)))
    trace.save(tmp_path / "trace.npz")
    assert smc.load(tmp_path / "trace.npz").scenario.clock == trace.scenario.clock
    worn = smc.condition("worn timer", clock=smc.Clock(jitter=0.003, missed=0.1))
    assert find_condition(str(worn)) == worn


def test_jitter_takes_margin_from_a_law_that_lives_near_its_delay():
    """A margin of jitter is a multiple of an eighth of the period, and a longer delay leaves less
    of it.
    """
    # MuJoCo runs it: the fast engine would compile for 5 s
    fields = {"control_period": 0.05, "duration": 5.0, "integrator": "implicitfast"}
    quick, slow = margins.margins_of(
        [
            smc.Scenario(
                plant="duffing",
                law=smc.law("classical"),
                input_delay=d,
                **fields,
            )
            for d in (0.0, 0.1)
        ],
        ["jitter"],
    )
    assert quick.value * 8 == round(quick.value * 8)
    assert not slow.value > quick.value


def test_a_jitter_where_a_period_has_one_step_is_told_of_a_shorter_step():
    with pytest.raises(smc.ScenarioError) as error:
        smc.Scenario(
            plant="duffing",
            law="none",
            physics_step=0.001,
            clock=smc.Clock(jitter=0.0005),
        )
    assert str(error.value) == (
        "Clock's jitter is 0.0005 s: give a physics_step of 0.00025 s, for example, and a jitter "
        "of at least a physics "
        "step, and less than the control period, 0.001 s, and missed=... for samples that do not "
        "run"
    )
