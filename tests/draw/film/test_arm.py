"""What films show of an arm: its tip's path until now, forces of contact, and blows."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import arms
from PIL import Image

import smc_mujoco as smc
from smc_mujoco.draw import style
from smc_mujoco.draw.film import arm
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


def overlay(trace, edges=EDGES, body=(9.0, 0.0, 9.0), hold=0.15):
    """What is drawn over an arm at the origin, of which every body is at one place, m."""
    stage = SimpleNamespace(
        track=SimpleNamespace(
            trace=trace, colour=COLOUR, edges=edges, holds=np.full(len(edges), hold)
        ),
        puppet=SimpleNamespace(height=0.0),
        followed=None,
        project=project,
        scale=1.0,
        words=[],
        find=lambda name: np.array(body),
    )
    return arm.overlays([stage])[0]


def paper():
    return np.full((SIZE[1], SIZE[0], 3), 255, np.uint8)


def drawn(shown, points):
    image = Image.fromarray(paper())
    shown.trail(image, points, COLOUR, 3.0)
    return np.asarray(image)


@pytest.mark.quick
@pytest.mark.parametrize(("followed", "first"), [(None, 50), (0, 100)])
def test_a_trail_is_drawn_until_now_from_a_second_before_if_followed(
    trace, monkeypatch, followed, first
):
    """A path goes 1 m/s to the right."""
    t = np.linspace(0.0, 2.0, 41)
    path = np.stack([t, 0.0 * t, np.ones(41)], axis=1)
    monkeypatch.setattr(tip, "tip_paths", lambda trace: (path, path[:1]))
    arm_overlay = overlay(dataclasses.replace(trace, t=t), np.array([1.48, 1.5]))
    arm_overlay.stage.followed = followed
    inked = (arm_overlay.over(paper(), 0)[100] == style.rgb(COLOUR)).all(axis=1)
    assert np.flatnonzero(inked)[[0, -1]] == pytest.approx([first, 200], abs=2)


def test_no_path_is_drawn_below_the_floor(trace, monkeypatch):
    low = np.array([[0.0, 0.0, 0.5], [0.5, 0.0, -0.5], [1.0, 0.0, -40.0]])
    monkeypatch.setattr(tip, "tip_paths", lambda trace: (low, low))
    arm_overlay = overlay(dataclasses.replace(trace, t=np.array([0.0, 0.1, 0.2])))
    floor = project(np.zeros((1, 3)))[0, 1]
    for path in (arm_overlay.path, arm_overlay.wanted):
        rows = np.flatnonzero((drawn(arm_overlay, path) != 255).any(axis=(1, 2)))
        assert floor - 55 <= rows.min() <= floor - 45
        assert rows.max() <= floor + 2


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
    arm_overlay = overlay(hit, body=body)
    before, during = (arm_overlay.over(paper(), frame) for frame in (0, 1))
    hue = np.array(style.rgb(style.DISTURBANCE))
    y, x = np.nonzero((during == hue).all(axis=2) & ~(before == hue).all(axis=2))
    assert 250 - 100 * arm.BLOW_DISTANCE - 3 <= x.max() <= 250 - 100 * arm.BLOW_DISTANCE + 1
    assert abs(np.median(y) - 100) <= 1
    # s, of frames; it is seen until 0.12 s of the run after its end
    edges = np.array([0.0, 0.02, 0.03, 0.14, 0.16, 0.18])
    frames = []
    for frame in range(5):
        frames.append(overlay(hit, edges, body, 0.12).over(paper(), frame))
    assert [(picture[y, x] == hue).all() for picture in frames] == [False, True, True, True, False]


def test_the_usual_force_of_a_contact_sets_the_scale_of_its_arrow(trace, monkeypatch):
    """It presses with 20 N downwards, after an impact; the arrow of the impact ends at the edge."""
    force = np.where(trace.t < 0.02, 500.0, 20.0)
    push = np.outer(force, [0.0, 0.0, 1.0])
    monkeypatch.setattr(tip, "knows_contacts", lambda scenario: True)
    monkeypatch.setattr(tip, "contacts", lambda trace: SimpleNamespace(push=push, force=force))
    arm_overlay = overlay(trace, body=(2.0, 0.0, 1.0))
    for frame, length in ((0, 220 - 100 - arm.RIM), (1, 100 * arm.FORCE_ARROW)):
        inked = arm_overlay.over(paper(), frame)[:, 250] == np.array(style.rgb(style.REACTION))
        rows = np.flatnonzero(inked.all(axis=1))
        assert 1 + np.ptp(rows) == pytest.approx(length, abs=3)
        assert (np.diff(rows) > 1).any() == (frame == 0)  # the one that is cut has a break mark
