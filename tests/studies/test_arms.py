"""Tasks of the arm: what seeds change, where the wall's path is, and the cost of the search for
gains.
"""

import re

import arms
import numpy as np
import pytest
from helpers.pages import ROOT

import smc_mujoco as smc
from benchmarks import arm_study
from smc_mujoco.mechanisms.plants import panda
from smc_mujoco.metrics.tip import tip_path

LAW = arms.gained("computed_torque_sliding")


def test_seeds_move_the_start_except_at_the_wall():
    for task in ("sway", "payload", "blow"):
        own, moved = (np.array(arms.scenario(task, LAW, seed).x0) for seed in (0, 3))
        assert own.tolist() == [signal.values[0] for signal in arms.scenario(task, LAW).references]
        assert 0.0 < np.abs(moved - own).max() <= arms.SPREAD
    for task in ("wall", "behind"):
        assert arms.scenario(task, LAW, 3).x0 == arms.scenario("wall", LAW).x0
    assert arms.scenario("wall", LAW, 3).seed == 3


@pytest.mark.quick
@pytest.mark.parametrize(
    ("task", "behind"),
    [
        ("wall", -5e-4),
        ("behind", 4e-3),
    ],
)
def test_the_walls_path_is_as_far_from_its_face_as_it_says(task, behind):
    scenario = arms.scenario(task, LAW)
    joints = np.array([signal.values for signal in scenario.references]).T
    probe = tip_path(scenario.plant, joints)[:, 0] + arms.PROBE
    np.testing.assert_allclose(probe, panda.WALL_DISTANCE + behind, atol=1e-6)


def test_the_cost_is_the_tips_rms_error_times_one_plus_the_variation():
    start = smc.plant("panda").rest
    trace = smc.run(
        smc.Scenario(
            plant="panda",
            law=LAW,
            reference=arms.sway(),
            x0=start,
            duration=0.05,
        )
    )
    rms = smc.metrics.tip_scores(trace)["rms_error"]
    rate = smc.score(trace)["tv_rate"]
    assert arm_study.cost(trace) == pytest.approx(1e3 * rms * (1.0 + rate / 1000.0))
    assert np.isfinite(arm_study.cost(trace))


def test_a_run_that_fails_does_not_come_back_to_its_path():
    n = 7
    t = np.array([0.0, 1.0, 2.0, 3.0])
    scenario = smc.Scenario(
        plant="panda",
        law=LAW,
        reference=arms.sway(),
        duration=3.0,
    )
    rest = np.tile(arms.arm().rest, (4, 1))
    zero = np.zeros((4, n))
    moved = rest + np.array([[0.0], [0.0], [1.0], [0.0]])
    failed = moved + np.array([[0.0], [0.0], [0.0], [np.nan]])
    for x, back in (
        (rest, 0.0),
        (moved, 2.0),
        (failed, np.inf),
        (rest + np.nan, np.inf),
    ):
        names = ("v", "u", "applied", "s", "d", "force", "reaction")
        trace = smc.Trace(
            t=t,
            x=x,
            r=rest,
            scenario=scenario,
            **dict.fromkeys(names, zero),
        )
        assert arms.back_within(trace, 1e-3, after=1.0) == back


def test_a_law_whose_error_depends_on_the_physics_step_is_called_unstable():
    """Time-delay control in the pick and place, 100, 177 or 129 mm by the step; computed torque is
    not.
    """
    for name, expected in (
        ("time_delay_sliding", True),
        ("computed_torque_sliding", False),
    ):
        runs = [arms.scenario("payload", arms.gained(name), seed=1)]
        assert arm_study.unstable(runs, smc.run(runs)) is expected


@pytest.mark.slow
def test_the_hybrid_law_presses_as_hard_as_it_should_and_stays_on_the_wall():
    """With the friction of a real arm, rubbing on the wall, and noise: within 5 %, and less than 1
    mm deep.
    """
    with_friction, unknown = smc.run(
        [
            arms.scenario("wall", arms.hybrid(friction=friction), seed=5)
            for friction in (True, False)
        ]
    )
    for trace in (with_friction, unknown):
        scores = smc.metrics.tip_scores(trace)
        assert abs(scores["force_error"]) < 5.0
        assert scores["touching"] == 100.0
        assert scores["depth"] < 1e-3
    assert (
        smc.metrics.tip_scores(with_friction)["force_ripple"]
        < smc.metrics.tip_scores(unknown)["force_ripple"]
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("task", "payload", "column"),
    [
        ("sway", 2.0, 0),
        ("payload", 0.0, 2),
    ],
)
def test_medians_of_the_page_are_those_of_its_runs(task, payload, column):
    """Each law's tip error and variation of u over 12 seeds, as `benchmarks/arm_study.py` prints
    them.
    """
    page = (ROOT / "docs" / "arms.md").read_text(encoding="utf-8")
    reported = {
        name + outer.replace(" on ", "_").replace(" ", "_"): cells.split(" | ")
        for name, outer, cells in re.findall(
            r"^\| `(\w+)`( on .*?)? \| (.* \| .* \| .*) \|$", page, re.MULTILINE
        )
    }
    assert [*reported] == [*arms.GAINS]
    for name in arms.GAINS:
        runs = []
        for seed in range(1, 13):
            runs.append(arms.scenario(task, arms.gained(name), seed, payload))
        traces = smc.run(runs)
        if arm_study.unstable(runs, traces):
            assert reported[name][column : column + 2] == ["unstable"] * 2, name
            continue
        rms = np.median([1e3 * smc.metrics.tip_scores(trace)["rms_error"] for trace in traces])
        rate = np.median(
            [
                max(scores["tv_rate"] for scores in smc.metrics.joint_scores(trace).values())
                for trace in traces
            ]
        )
        assert f"{rms:.3g}" == reported[name][column].split()[0], name
        assert float(reported[name][column + 1]) == pytest.approx(rate, rel=0.005), name
