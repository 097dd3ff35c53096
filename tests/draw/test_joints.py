"""The figure of an arm: a panel a joint and one for the tip, marks of what happens, and runs that are far off."""

import dataclasses

import numpy as np
import pytest
from helpers import arms

import smc_mujoco as smc
from smc_mujoco.draw import panels, style
from smc_mujoco.draw.joints import joints


@pytest.fixture(scope="module")
def trace():
    law = smc.law("computed_torque_sliding", c=8.0)
    return smc.run(smc.Scenario(plant=arms.arm(), law=law, reference=smc.Sine(0.3, 4.0), x0=0.2, duration=0.3))


def shown(page):
    return [ax for ax in page.axes if ax.get_visible()]


def test_each_panel_says_what_it_shows_in_its_unit(trace):
    page = joints([trace])
    titles = [ax.get_title(loc="left") or ax.get_title() for ax in shown(page)]
    expected = ["reach, error (mm)", "turn, error (mrad)", "lift, error (mrad)", "tip off its path (mm)"]
    assert titles == expected
    assert len(page.axes) == len(expected)  # no cell is empty
    np.testing.assert_allclose(shown(page)[1].lines[0].get_ydata(), 1e3 * (trace.x - trace.r)[:, 1])
    column = joints([trace], size="ieee-column")
    column.draw_without_rendering()
    assert len(column.axes) == len(expected)
    assert max(ax._left_title.get_window_extent().x1 for ax in column.axes) < column.bbox.x1


def test_a_run_far_off_leaves_its_panel_by_name(trace):
    far = dataclasses.replace(trace, x=trace.r + 50.0 * (trace.x - trace.r))
    ax = shown(joints([trace, far], labels=["near", "far"]))[0]
    error = 1e3 * np.abs(trace.x - trace.r)[:, 0].max()
    assert [text.get_text() for text in ax.texts] == [f"far: up to {style.short(50.0 * error)}"]
    low, high = ax.get_ylim()
    assert max(-low, high) < 3.0 * error
    assert not shown(joints([trace, trace], labels=["near", "same"]))[0].texts
    lost = dataclasses.replace(far, diverged_at=0.2, failure="the law raised ValueError: no")
    page = joints([trace, lost], labels=["near", "lost"])
    assert page.legends[0].get_texts()[1].get_text() == "lost (failed at 0.2 s)"
    ax = shown(page)[0]
    assert "X" in [line.get_marker() for line in ax.lines]
    assert not ax.texts  # a failed run does not set the range, here or in films
    assert panels.outside(panels.Panel("tip", next(iter(style.split([trace]))), [trace, lost]), ["a", "b"]) == ("", "")


def test_curves_that_coincide_are_dashed_in_turn(trace):
    (one, other) = shown(joints([trace, trace], labels=["one", "other"]))[0].lines[:2]
    assert one.get_linestyle() == other.get_linestyle() == "--"


def test_a_blow_and_a_payload_are_marked_and_named(trace):
    push = smc.Push("hand", y=30.0, z=40.0, time=0.1, width=0.02)
    hit = dataclasses.replace(trace, scenario=dataclasses.replace(trace.scenario, disturbance=push))
    page = joints([hit])
    assert [text.get_text() for text in page.legends[0].get_texts()][-1] == "blow of 50 N for 20 ms at 0.1 s"
    assert all([0.1, 0.1] in [list(line.get_xdata()) for line in ax.lines] for ax in shown(page))
    push = smc.Push("link5", y=30.0, z=40.0, time=0.001, width=0.02)
    picked = smc.Scenario(
        plant="panda", law="none", jump=smc.Jump(0.001, {"payload": 2.0}), disturbance=push, duration=0.002
    )
    (run,) = smc.run([picked])
    assert style.marks([run], ["none"]) == {0.001: "blow of 50 N for 20 ms; payload + 2 kg"}
    assert style.jumps([run], ["none"]) == {0.001: "payload + 2 kg"}


def test_panels_below_a_film_of_an_arm_tell_what_the_tip_does(trace):
    strip = panels.strip([trace])
    assert [panel.quantity for panel in strip] == ["tip", "worst", "worst"]  # joints that slide and that turn
    assert [panel.label for panel in strip] == [
        "tip off its path (mm)",
        "largest error of a joint (mm)",
        "largest error of a joint (mrad)",
    ]
