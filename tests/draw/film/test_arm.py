"""What films show of an arm: its tip's path until now, torques against their limits, forces of
contact, and blows.
"""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import arms
from PIL import Image

import smc_mujoco as smc
from smc_mujoco.draw import style
from smc_mujoco.draw.film import arm, pace
from smc_mujoco.metrics import tip

COLOUR = "#0072B2"
SIZE = (400, 220)
EDGES = np.array([0.0, 0.02, 0.04])


def project(points):
    """A camera that sees x to the right and z up, 100 px a metre."""
    return np.array([50.0, 200.0]) + 100.0 * points[:, [0, 2]] * (1.0, -1.0)


@pytest.fixture(scope="module")
def trace():
    law = smc.law("computed_torque_sliding", c=8.0)
    bounds = [4.0, 2.0, 9.0]
    scenario = smc.Scenario(
        plant=arms.arm(),
        law=law,
        reference=smc.Sine(0.3, 4.0),
        x0=0.2,
        u_max=bounds,
        duration=0.5,
    )
    return smc.run(scenario)


def struck(trace, **fields):
    return dataclasses.replace(trace, scenario=dataclasses.replace(trace.scenario, **fields))


def overlay(trace, edges=EDGES, body=(9.0, 0.0, 9.0)):
    """What is drawn over an arm at the origin, of which every body is at one place, m."""
    stage = SimpleNamespace(
        track=SimpleNamespace(trace=trace, colour=COLOUR, edges=edges),
        puppet=SimpleNamespace(height=0.0),
        project=project,
        scale=1.0,
        find=lambda name: np.array(body),
    )
    (shown,) = arm.overlays([stage], [np.array([100.0, 150.0, 300.0, 210.0])])
    return shown


def paper():
    return np.full((SIZE[1], SIZE[0], 3), 255, np.uint8)


def drawn(shown, points):
    image = Image.fromarray(paper())
    shown.trail(image, points, COLOUR, 3.0)
    return np.asarray(image)


def test_a_trail_is_drawn_until_now(trace):
    """A path goes right, then down."""
    corners = np.array([[0.0, 1.7], [0.4, 1.7], [0.4, 1.1]])
    points = np.stack(
        [np.interp(np.linspace(0.0, 2.0, 41), [0.0, 1.0, 2.0], part) for part in corners.T], axis=1
    )
    points = np.insert(points, 1, 0.0, axis=1)
    shown = overlay(trace)
    early = drawn(shown, points[:11])
    late = drawn(shown, points)
    for picture, x, y, inked in (
        (early, 55, 30, True),
        (early, 75, 30, False),
        (late, 75, 30, True),
        (late, 90, 80, True),
        (late, 75, 34, False),
    ):
        assert (picture[y, x].tolist() == list(style.rgb(COLOUR))) is inked
    assert (drawn(shown, points - 1000.0) == 255).all()  # outside the picture


def test_no_path_is_drawn_below_the_floor(trace, monkeypatch):
    low = np.array([[0.0, 0.0, 0.5], [0.5, 0.0, -0.5], [1.0, 0.0, -40.0]])
    monkeypatch.setattr(tip, "tip_paths", lambda trace: (low, low))
    shown = overlay(dataclasses.replace(trace, t=np.array([0.0, 0.1, 0.2])))
    floor = project(np.zeros((1, 3)))[0, 1]
    for path in (shown.path, shown.wanted):
        rows = np.flatnonzero((drawn(shown, path) != 255).any(axis=(1, 2)))
        assert floor - 55 <= rows.min() <= floor - 45
        assert rows.max() <= floor + 2


def test_bars_are_shares_of_each_joints_limit(trace):
    assert arm.has_bars(trace)
    # volts
    assert not arm.has_bars(
        struck(trace, actuator=smc.DCMotor(command="voltage", gear=50.0), u_max=None)
    )
    bars = overlay(trace)
    expected = trace.applied[:20].mean(axis=0) / np.array([4.0, 2.0, 9.0])
    assert bars.shares is not None
    np.testing.assert_allclose(bars.shares[0], expected, atol=0.05)
    beyond = np.where(trace.t[:, None] < EDGES[1], 1.5, -1.5) * [4.0, 2.0, 9.0]
    np.testing.assert_array_equal(
        overlay(dataclasses.replace(trace, applied=beyond)).shares, [[1.0] * 3, [-1.0] * 3]
    )
    bars.shares[0] = (0.5, -1.0, 0.0)
    image = bars.beside(paper() // 2, 0)
    zero = float(bars.room[[1, 3]].mean())
    middles = []
    for i in range(3):
        middles.append(round(100.0 + i * (arm.BAR_WIDTH + arm.BAR_GAP) + arm.BAR_WIDTH / 2))
    quarter = round(arm.BAR_HEIGHT / 8)
    up = round(zero) - quarter
    down = round(zero) + quarter
    assert image[up, middles[0]].tolist() == list(style.rgb(COLOUR))
    assert image[down, middles[0]].tolist() == list(style.rgb(style.PAPER))
    # all that the motor has
    assert image[down, middles[1]].tolist() == list(style.rgb(style.FAILED))
    assert (
        image[up, middles[2]].tolist()
        == image[down, middles[2]].tolist()
        == list(style.rgb(style.PAPER))
    )


def test_a_blow_is_an_arrow_that_ends_before_its_body(trace):
    hit = struck(
        trace,
        disturbance=smc.signals.Push(
            "hand",
            x=50.0,
            time=0.021,
            width=0.01,
        ),
    )
    body = (2.0, 0.0, 1.0)  # 250, 100 px
    shown = overlay(hit, body=body)
    before, during = (shown.over(paper(), frame) for frame in (0, 1))
    hue = np.array(style.rgb(style.DISTURBANCE))
    y, x = np.nonzero((during == hue).all(axis=2) & ~(before == hue).all(axis=2))
    assert 250 - 100 * arm.BLOW_DISTANCE - 3 <= x.max() <= 250 - 100 * arm.BLOW_DISTANCE + 1
    assert abs(np.median(y) - 100) <= 1
    # s, of frames; it is seen until 0.12 s after its end
    edges = np.array([0.0, 0.02, 0.03, 0.14, 0.16, 0.18])
    frames = []
    for frame in range(5):
        frames.append(overlay(hit, edges, body).over(paper(), frame))
    assert [(each[y, x] == hue).all() for each in frames] == [False, True, True, True, False]


def test_a_blow_on_an_arm_is_shown_in_slow_motion(trace, monkeypatch):
    still = dataclasses.replace(trace, x=np.zeros_like(trace.x))
    hit = struck(
        still,
        disturbance=smc.signals.Push(
            "hand",
            y=50.0,
            time=0.3,
            width=0.02,
        ),
    )
    found = pace.clock([hit], 30.0)
    slow = np.abs(found.times - 0.31) < 0.02
    assert slow.sum() > 5
    assert found.speeds[slow].tolist() == [0.5**pace.MAX_HALVINGS] * slow.sum()
    assert pace.clock([still], 30.0).speeds.min() == pace.REST_SPEED
    monkeypatch.setattr(pace, "MAX_LENGTH", (1.0, 0.0))
    assert len(pace.clock([hit], 30.0).times) <= 0.5 * 30 + 2
