"""What films show of an arm: the path of its tip until now, and bars of torque against their limits."""

import mujoco
import numpy as np
import pytest
from helpers import arms

import smc_mujoco as smc
from smc_mujoco.draw import style
from smc_mujoco.draw.film import arm
from smc_mujoco.metrics.tip import tip_path

COLOUR = "#0072B2"


@pytest.fixture(scope="module")
def trace():
    law = smc.law("computed_torque_sliding", c=8.0)
    bounds = [4.0, 2.0, 9.0]
    scenario = smc.Scenario(plant=arms.arm(), law=law, reference=smc.Sine(0.3, 4.0), x0=0.2, u_max=bounds, duration=0.5)
    return smc.run(scenario)


def test_the_path_is_drawn_until_now(trace):
    place = np.array([1.0, 2.0, 0.0])
    path, shown = arm.Path(trace, place, COLOUR), mujoco.MjvScene(trace.scenario.plant.load(), maxgeom=500)
    points = place + tip_path(trace.scenario.plant, trace.x)
    counts = []
    for time in (0.1, 0.4):
        shown.ngeom = 0
        path.draw(shown, time, points[round(1e3 * time)])
        rods = [
            rod for rod in shown.geoms[: shown.ngeom] if np.allclose(rod.rgba[:3], np.array(style.rgb(COLOUR)) / 255)
        ]
        counts.append(len(rods))
        ends = np.array([rod.pos for rod in rods])
        late = points[round(1e3 * time) :]
        assert np.linalg.norm(ends[-1] - late[0]) < 0.02
        assert np.linalg.norm(ends[0] - points[0]) < 0.02
    assert counts[1] > 2 * counts[0] > 10


def test_bars_are_shares_of_each_joints_limit(trace):
    assert arm.has_bars(trace)
    edges = np.array([0.0, 0.02, 0.04])
    bars = arm.Bars([trace], edges, [COLOUR], top=10.0, scale=1.0)
    expected = trace.applied[:20].mean(axis=0) / np.array([4.0, 2.0, 9.0])
    np.testing.assert_allclose(bars.shares[0][0], expected, atol=0.05)
    bars.place(np.array([[100.0, 50.0, 300.0, 200.0]]), 400)
    bars.shares[0][0] = (0.5, -1.0, 0.0)
    image = bars.over(np.full((220, 400, 3), 128, np.uint8), 0)
    left, zero = bars.lefts[0], 10.0 + 1.4 * arm.LETTERS + arm.HEIGHT / 2
    middles = [round(left + arm.GAP + i * (arm.BAR + arm.GAP) + arm.BAR / 2) for i in range(3)]
    quarter = round(arm.HEIGHT / 8)
    up, down = round(zero) - quarter, round(zero) + quarter
    assert image[up, middles[0]].tolist() == list(style.rgb(COLOUR))
    assert image[down, middles[0]].tolist() == list(style.rgb(style.PAPER))
    assert image[down, middles[1]].tolist() == list(style.rgb(style.FAILED))  # all that the motor has
    assert image[up, middles[2]].tolist() == image[down, middles[2]].tolist() == list(style.rgb(style.PAPER))
