"""The figure of an arm: small panels of each joint and one of the tip, and marks of what
happens.
"""

import dataclasses
import math

import pytest
from helpers import arms

import smc_mujoco as smc
from smc_mujoco.draw import timed_events
from smc_mujoco.draw.figure import figure
from smc_mujoco.draw.film import charts


@pytest.fixture(scope="module")
def trace():
    law = smc.law("computed_torque_sliding", c=8.0)
    return smc.run(
        smc.Scenario(
            plant=arms.arm(),
            law=law,
            reference=smc.Sine(0.3, 4.0),
            x0=0.2,
            duration=0.3,
        )
    )


def test_a_blow_and_a_payload_are_marked_and_named(trace):
    push = smc.signals.Push(
        "hand",
        y=30.0,
        z=40.0,
        time=0.1,
        width=0.02,
    )
    hit = dataclasses.replace(trace, scenario=dataclasses.replace(trace.scenario, disturbance=push))
    page = figure([hit])
    time_axes = page.axes[:4]
    assert time_axes[3].get_ylabel().startswith("tip off its path")
    assert [text.get_text() for ax in time_axes for text in ax.texts] == ["blow of 50 N for 20 ms"]
    assert page.get_label().endswith("dots: blow")
    for ax in time_axes:
        assert [0.1, 0.1] in [list(line.get_xdata()) for line in ax.lines]
    push = smc.signals.Push(
        "link5",
        y=30.0,
        z=40.0,
        time=0.001,
        width=0.02,
    )
    picked = smc.Scenario(
        plant="panda",
        law="none",
        jump=smc.Jump(0.001, {"payload": 2.0}),
        disturbance=push,
        duration=0.002,
    )
    (run,) = smc.run([picked])
    events = timed_events.events([run], ["none"])
    assert timed_events.marks(events) == {0.001: "blow of 50 N for 20 ms; payload + 2 kg"}
    assert [event.stop for event in events] == [pytest.approx(0.021), math.inf]


@pytest.mark.quick
def test_panels_below_a_film_of_an_arm_tell_what_the_tip_does(trace):
    strip = charts.strip([trace])
    # joints that slide and that turn
    assert [panel.quantity for panel in strip] == ["tip", "load"]
    assert [panel.label for panel in strip] == [
        "tip off its path (mm)",
        "largest |u| (% of limit)",
    ]
