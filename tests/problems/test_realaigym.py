"""RealAIGym's boards (benchmarks/realaigym): published scores, the published simulator against
MuJoCo and its own numbers, and this package's rows.

Numbers without a formula are those of the published code, run unchanged on 2026-11-23 (repository
dfki-ric-underactuated-lab/double_pendulum, commit 1e8544e).
"""

import math
import re
from types import SimpleNamespace

import boards as script
import numpy as np
import pytest
import realaigym as boards
from helpers.pages import ROOT
from realaigym import global_policy, swing_ups
from realaigym.scoring import VERSIONS
from realaigym.simulator import Case, Machine

import smc_mujoco as smc

ROBOTS = pytest.mark.parametrize("robot", boards.ROBOTS)
# channels of shoulder and elbow
ORDER = {
    "acrobot": [1, 0],
    "pendubot": [0, 1],
}
DIGITS = {"torque_smoothness": 3}  # of the published criteria after the point; of the others 2
DRAWN = {  # seed -> first times of resets, and goals
    333: ((3.9924, 8.2595, 11.3649, 15.6190, 18.2143),
          ((0.27201, 1.43854), (-0.82485, -2.83809), (-1.59968, 2.3467))),
    777: ((4.0065, 6.5967, 10.3490, 15.6826, 18.9549),
          ((-2.18237812, -1.24183005), (2.10646, 2.6829), (-1.45013, 0.90496))),
}  # fmt: skip
STATES = {  # seed -> time, s -> state under u = 0
    333: {
        4.2: (0.069803, 0.853357, 1.722369, 2.993765),
        6.0: (0.711255, -0.116228, -1.005636, -3.279171),
        10.0: (0.112146, -1.612764, 0.172681, -7.424433),
        12.0: (0.383254, -1.167559, 5.744387, -5.488736),
    },
    777: {
        4.2: (-0.346767, -0.588496, -5.374484, -2.003267),
        6.0: (-1.402629, -0.257037, -4.742809, 3.535720),
        12.0: (37.625280, 6.651855, 11.217737, -8.977259),
    },
}
PUSHED = {  # seed -> first and last samples of two resets, s
    333: ((3.994, 4.194), (8.260, 8.458)),
    777: ((4.008, 4.208), (6.598, 6.798)),
}
UPRIGHT_GAINS = {
    "pendubot": (57.254203, 54.500374, 13.305076, 9.668627),
    "acrobot": (255.754194, 107.575098, 54.153341, 24.868653),
}


@pytest.fixture(scope="module")
def traces():
    """The run of our entry of each robot."""
    robot_traces = smc.run([boards.entry(robot) for robot in boards.ROBOTS])
    return dict(zip(boards.ROBOTS, robot_traces, strict=True))


@pytest.mark.quick
@pytest.mark.parametrize("version", VERSIONS)
@ROBOTS
def test_published_criteria_give_their_published_score(robot, version):
    """Within what the rounding of the criteria leaves open, up to 0.004, and half a digit."""
    for row in boards.SIMULATION[robot][version]:
        ends = []
        for side in (1.0, -1.0):
            values = row._asdict()
            for name in VERSIONS[version]:
                values[name] += side * 0.5 * 10.0 ** -DIGITS.get(name, 2)
            ends.append(boards.score(values, version))
        assert ends[0] - 5e-4 <= row.score <= ends[1] + 5e-4, row.name
        assert boards.score(row, version) == pytest.approx(row.score, abs=0.0023), row.name


def of_arrays(t, q, v, u, robot):
    """Criteria of a motion of shoulder and elbow."""
    scenario = smc.Scenario(plant=robot, law="none")
    order = ORDER[robot]
    trace = SimpleNamespace(
        t=t,
        x=q[:, order],
        v=v[:, order],
        u=u[:, None],
        scenario=scenario,
        failure=None,
    )
    return boards.criteria(trace)


def test_criteria_of_a_motion_are_those_of_its_formula():
    t = np.arange(1001) * 0.01
    q = np.zeros((1001, 2))
    v = np.zeros((1001, 2))
    u = np.where(np.arange(1001) % 2, 1.0, -1.0)
    q[:, 0] = np.where(t < 3.995, 0.0, math.pi)  # up from the sample at 4 s
    v[:, 1] = 2.0
    criteria = of_arrays(t, q, v, u, "pendubot")
    assert criteria == pytest.approx((4.0, math.pi, 1.0, 10.0, 10.0, 2.0, 40.0))
    q[900, 0] = 0.0  # falls once
    assert of_arrays(t, q, v, u, "acrobot").swing_up_time == pytest.approx(9.01)
    q[-2:, 0] = 0.0
    assert not of_arrays(t, q, v, u, "acrobot").success


@pytest.mark.slow
@ROBOTS
def test_the_published_simulator_is_mujocos(robot, traces):
    states, torque = Machine(boards.entry(robot)).simulate(Case())
    order = ORDER[robot]
    np.testing.assert_allclose(states[:, :2], traces[robot].x[:, order], atol=1e-8)
    np.testing.assert_allclose(states[:, 2:], traces[robot].v[:, order], atol=1e-7)
    np.testing.assert_allclose(torque, traces[robot].u[:-1, 0], atol=1e-7)


# the board of 2025


@pytest.mark.parametrize("seed", DRAWN)
def test_a_minute_is_that_of_the_published_simulator(seed):
    times, goals = global_policy.resets(seed)
    np.testing.assert_allclose(
        times[:5],
        DRAWN[seed][0],
        rtol=0,
        atol=5.1e-5,
    )
    np.testing.assert_allclose(
        goals[:3],
        DRAWN[seed][1],
        rtol=0,
        atol=5.1e-6,
    )
    run = global_policy.minute(boards.on_board("pendubot", "none"), seed)
    for time, state in STATES[seed].items():
        np.testing.assert_allclose(
            run.states[round(time / 2e-3)],
            state,
            rtol=0,
            atol=2e-6,
        )
    pushed = np.flatnonzero(np.abs(run.torques).sum(axis=1))
    ends = np.flatnonzero(np.diff(pushed) > 1)
    begun = pushed[[0, *(ends + 1)]]
    angles = np.column_stack([begun[:2], pushed[ends][:2]])
    np.testing.assert_allclose(2e-3 * angles, PUSHED[seed], atol=1e-9)
    first = run.torques[begun[0] : begun[0] + 4]
    if seed == 333:
        np.testing.assert_allclose(
            first[:, 0], (2.720086, 2.723832, 3.884847, 4.605569), rtol=0, atol=1e-6
        )
    assert first[:, 1] == pytest.approx(6.0 if seed == 333 else -6.0)


@ROBOTS
def test_the_linear_law_is_the_published_one(robot):
    law, _ = swing_ups.upright_law(robot)
    np.testing.assert_allclose(law, np.negative(UPRIGHT_GAINS[robot]), rtol=1e-6)


# this package's rows


@pytest.mark.slow
@ROBOTS
def test_scores_of_the_page_are_those_of_the_boards(robot):
    page = (ROOT / "docs" / "boards.md").read_text(encoding="utf-8")
    rows = boards.experiments(robot)
    column = 2 * boards.ROBOTS.index(robot)
    score = {}
    for row in boards.board(dict(zip(rows, smc.run([*rows.values()]), strict=True))):
        score[row.name] = row.score
    tested = {name: boards.robustness(scenario) for name, scenario in rows.items()}
    robust = {row.name: row.score for row in boards.robustness_board(robot, tested)}
    cells = re.findall(r"^\| ([^|]*?)(?: \(.*|,.*)?" + 4 * r" \| ([.0-9]+)" + r" \|$", page, re.M)
    assert len(cells) == 9
    for name, *values in cells:
        assert values[column] == f"{score[name]:.3f}", name
        assert float(values[column + 1]) == pytest.approx(robust[name], abs=0.005), name


def test_a_folder_enters_the_boards_in_place_of_this_packages_rows(capsys):
    folder = str(ROOT / "examples" / "entries" / "soft_relay")
    script.main(["acrobot", "--no-robustness", "--entry", folder])
    printed = capsys.readouterr().out
    assert printed.count("soft relay") == 2
    assert "trajectory + " not in printed
    assert printed.index("History SAC") < printed.index("soft relay")
