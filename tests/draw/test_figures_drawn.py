"""What every figure holds to, whatever it shows: names with units, colours in the legend, data
whole and inside.
"""

import dataclasses
import re

import numpy as np
import pytest
from helpers import arms
from helpers.drawn_pages import every, has_units_names_and_places, places
from helpers.runs import at_defaults
from helpers.sketch import failed, made
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import smc_mujoco as smc
from smc_mujoco.draw import colouring, panels, style, wording
from smc_mujoco.draw.figure import figure
from smc_mujoco.mechanisms.hardware.friction import Coulomb
from smc_mujoco.robustness import region_figure
from smc_mujoco.robustness.region_of_attraction import CONVERGES, DOES_NOT, UNDECIDED, Basin
from smc_mujoco.simulation.trace import PLANT_DIVERGED

SINE = smc.Sine(0.3, 4.0)
ALL = (
    "x",
    "error",
    "spread",
    "v",
    "u",
    "delivered",
    "reaction",
    "d",
    "s",
    "channels",
    "phase",
    "settling",
    "end",
)


def switching(trace: smc.Trace, size: float) -> smc.Trace:
    """The trace with a control that switches at irregular samples around its mean."""
    signs = np.where(np.arange(len(trace.t)) * 7 % 11 % 3 % 2, 1.0, -1.0)
    return dataclasses.replace(trace, u=trace.u + size * signs[:, None])


def duffing(law: str, **fields) -> smc.Trace:
    return made(smc.Scenario(plant="duffing", law=at_defaults(law), **{"duration": 1.2} | fields))


def machines() -> list[smc.Trace]:
    """Friction, a gear, a jump and a failure."""
    parts = {
        "friction": Coulomb(0.4),
        "actuator": smc.Backlash(0.04),
        "reference": SINE,
    }
    jumping = duffing("classical", jump=smc.Jump(0.5, {"mass": 2.0}), **parts)
    lost = failed(duffing("adaptive", **parts), 700, f"{PLANT_DIVERGED}, at t = 0.7 s")
    rests = dataclasses.replace(jumping, v=np.where(jumping.t < 0.8, 1.0, 0.0)[:, None] * jumping.v)
    return [switching(rests, 1.0), switching(duffing("super_twisting", **parts), 0.7), lost]


def network() -> list[smc.Trace]:
    plant = smc.plant("pendulum_network", n=11)
    return [
        made(smc.Scenario(plant=plant, law=at_defaults(law), duration=0.3))
        for law in ("classical", "adaptive")
    ]


def cart() -> list[smc.Trace]:
    trace = made(
        smc.Scenario(
            plant="cart_pole",
            law="classical",
            duration=0.4,
            contact="none",
            friction=Coulomb(0.01),
        )
    )
    return [dataclasses.replace(trace, x=0.01 * trace.x, u=0.02 * trace.u)]


def arm() -> list[smc.Trace]:
    """One run, and one that is far off."""
    near = made(
        smc.Scenario(
            plant=arms.arm(),
            law=smc.law("none"),
            reference=SINE,
            duration=0.3,
        )
    )
    return [near, dataclasses.replace(near, x=near.r + 50.0 * (near.x - near.r))]


def basins() -> list[Basin]:
    outcome = np.array(
        [[CONVERGES, CONVERGES, DOES_NOT], [CONVERGES, UNDECIDED, DOES_NOT]], np.int8
    )
    decided = np.array([[2.0, 4.0, 8.0], [8.0, 16.0, 1.0]])
    names = {
        "plant": "van_der_pol",
        "unit": "m",
        "duration": 16.0,
        "outcome": outcome,
        "decided_at": decided,
    }
    grid = {"x": np.array([-1.0, 0.0, 2.0]), "v": np.array([-3.0, 3.0])}
    return [
        Basin(
            law="classical",
            source="tuned here",
            **names,
            **grid,
        ),
        Basin(law="adaptive", **names, **grid),
    ]


PAGES = {
    "machines": lambda: figure(machines()),
    "network": lambda: figure(network(), title="Pendulums", size=(9.0, 6.0)),
    "every panel": lambda: figure(cart(), size="ieee-column", panels=ALL, labels=["small"]),
    "arm": lambda: figure(arm(), labels=["near", "far"]),
    "maps": lambda: region_figure.draw_regions(basins()),
}


@pytest.mark.parametrize("kind", PAGES)
def test_every_axis_has_its_unit_every_colour_its_name_and_every_mark_a_place(kind):
    has_units_names_and_places(PAGES[kind]())


def unprefixed(label: str) -> str:
    """The label with its unit, whatever the prefix of the unit."""
    return re.sub(r"\([mµ](?=[mrNV])", "(", label)


def shown(page, label: str) -> Axes:
    return next(ax for ax in page.axes if label in (ax.get_ylabel(), unprefixed(ax.get_ylabel())))


def curve(ax: Axes, colour: str) -> np.ndarray:
    """The line of a trace as (times, values), without its marks."""
    lines = []
    for line in ax.lines:
        if to_hex(line.get_color()) == to_hex(colour) and line.get_marker() == "None":
            lines.append(line)
    assert len(lines) == 1
    return places(lines[0]).T


MOTOR = smc.DCMotor(8.4, 1e-3, 0.042, 1.0, 4e-6, voltage=10.0)
ARM = """
<mujoco><worldbody><body><joint name="lift" type="slide" axis="0 0 1"/><geom size=".1" contype="0"/>
  <body pos=".3 0 0"><joint name="turn" axis="0 1 0"/><geom size=".1"
    contype="0"/></body></body></worldbody>
<actuator><motor joint="lift"/><motor joint="turn"/></actuator></mujoco>"""
PANELS = {  # what is run -> labels that a figure of it has, and parts of labels that it has not
    "ideal": (
        {"plant": "duffing"},
        ["position x (m)", "control u (N)", "its rate e′ (m/s)"],
        ["reaction", "delivered"],
    ),
    "friction": ({"plant": "duffing", "friction": Coulomb(0.5)}, ["reaction (N)"], ["delivered"]),
    "a drive": ({"plant": "duffing", "actuator": smc.Lag(0.05)}, ["delivered (N)"], ["reaction"]),
    "a pole": (
        {"plant": "cart_pole", "law": "hierarchical", "model": "nominal"},
        [
            "position x (m)",
            "its rate e′ (m/s)",
            "free angle q (rad)",
            "its rate e′ (rad/s)",
            "control u (N)",
        ],
        ["reaction", "sliding variable s ("],  # whose unit is the law's
    ),
    "a pole with friction": (
        {"plant": "cart_pole", "friction": {"*": Coulomb(0.01)}},
        ["reaction (N)", "reaction on q (N·m)"],
        [],
    ),
    "a network with friction": (
        {"plant": "pendulum_network", "friction": Coulomb(0.2)},
        ["angle x (rad)", "max − min x (rad)", "control u (N·m)", "reaction (N·m)"],
        ["mean x"],
    ),
    "a slide and a hinge": (
        {"plant": smc.plant_from(ARM, ["lift", "turn"], name="own")},
        ["lift x (m)", "turn x (rad)", "lift u (N)", "turn u (N·m)"],
        ["mean"],
    ),
    "a pushed arm": (
        {"plant": arms.arm(), "law": "none", "disturbance": smc.Constant(1.0)},
        ["lift e (rad)", "disturbance d (N·m)"],
        ["mean"],
    ),
    "volts": (
        {
            "plant": "furuta",
            "law": "none",
            "actuator": dataclasses.replace(MOTOR, command="voltage"),
        },
        ["control u (V)", "reaction (N·m)"],
        ["u (N·m)", "sliding variable"],  # the law has none
    ),
    "torques": (
        {"plant": "furuta", "law": "none", "actuator": MOTOR},
        ["control u (N·m)"],
        ["(V)"],
    ),
}


@pytest.mark.parametrize("kind", PANELS)
def test_a_figure_has_the_panels_that_its_mechanism_has_in_their_units_and_no_others(kind):
    fields, labels, absent = PANELS[kind]
    trace = made(smc.Scenario(**{"law": smc.law("classical"), "duration": 0.2} | fields))
    if "friction" not in fields and trace.scenario.plant.name != "furuta":
        trace = dataclasses.replace(trace, reaction=0.0 * trace.reaction)
    if trace.scenario.law.name == "none":
        trace = dataclasses.replace(trace, s=0.0 * trace.s)
    words = []
    for ax in figure(trace).axes:
        words.append(unprefixed(ax.get_ylabel().replace("\n", " ")))
    assert set(labels) <= set(words), words
    assert not [part for part in absent if part in " ".join(words)]


def test_lines_and_bands_are_the_run_from_its_start_to_its_end_or_its_failure():
    traces = machines()
    page = figure(traces)
    colours = colouring.law_colours([trace.scenario.law for trace in traces])
    ends = [1.2, 1.2, 0.699]
    for label, values in {
        "position x (m)": "x",
        "reaction (N)": "reaction",
        "delivered (N)": "force",
    }.items():
        for trace, colour, end in zip(traces, colours, ends, strict=True):
            t, y = curve(shown(page, label), colour)
            t, y = t[t < end + 1e-6], y[t < end + 1e-6]
            truth = getattr(trace, values)[trace.t <= end + 1e-9, 0]
            crosses = [
                places(line)[0].tolist()
                for line in shown(page, label).lines
                if line.get_marker() == "X"
            ]
            assert end == 1.2 or crosses == [pytest.approx([end, truth[-1]])]
            assert (t[0], t[-1]) == pytest.approx((0.0, end))
            assert (y[0], y[-1], y.min(), y.max()) == pytest.approx(
                (truth[0], truth[-1], truth.min(), truth.max())
            )
    rows = shown(page, "control u (N)").child_axes
    keys = [row.get_legend() for row in rows]
    names = []
    for key in keys:
        if key:
            for text in key.get_texts():
                names.append((text.get_text(), text.get_color()))
    assert names == [(name, style.INK) for name in ("Classical", "Super-twisting", "Adaptive")]
    for trace, row in zip(traces, rows, strict=True):
        (band,) = row.collections
        low, high = band.get_paths()[0].get_extents().intervaly
        assert (low, high) == pytest.approx((np.nanmin(trace.u), np.nanmax(trace.u)))
        assert np.abs(curve(row, row.lines[0].get_color())[1]).max() < 0.5  # the mean has no teeth
    marks = [line for ax in every(page) for line in ax.lines if line.get_marker() == "X"]
    assert {to_hex(mark.get_color()) for mark in marks} == {to_hex(colours[2])}
    assert sum(places(mark)[0, 0] == pytest.approx(0.699) for mark in marks) >= 5
    jumps = []
    for line in shown(page, "position x (m)").lines:
        if places(line)[:, 0].tolist() == [0.5, 0.5]:
            jumps.append(line)
    assert len(jumps) == 1


@pytest.mark.quick
def test_every_joint_has_the_band_of_the_score_that_of_the_largest_error_at_the_start():
    """A joint near its goal had a narrower one, which a settled run left."""
    arm = smc.plant("double_pendulum")
    run = made(smc.Scenario(plant=arm, law=at_defaults("pid"), x0=(0.5, -0.1), duration=1.0))
    heights = []
    for panel in panels.by_channel(panels.of_groups([run], "x")[0]):
        heights.append(panel.band(panel.traces[0]))
    assert heights == pytest.approx([0.02 * np.abs(run.x[0] - run.r[0]).max()] * 2)


def test_the_worst_joints_of_many_come_first_with_their_controls_beside_them(monkeypatch):
    """The run that is far off counts, and each joint in the scale of its kind."""
    traces = arm()
    error = np.abs(traces[1].x - traces[1].r)
    assert error[:, 0].mean() > error[:, 2].mean(), (
        "but lift's is the largest of all scales: 1 m and 0.6 rad"
    )
    page = figure(traces, labels=["near", "far"])
    errors = ["reach e (m)", "turn e (rad)", "lift e (rad)"]  # all have a place, as in the model
    controls = ["reach u (N)", "turn u (N·m)", "lift u (N·m)"]
    labels = [ax.get_ylabel() for ax in page.axes]
    assert labels[:3] == errors
    assert [label for label in labels if " u " in label] == controls
    monkeypatch.setattr("smc_mujoco.draw.figure.MAX_WORST", 2)
    page = figure(traces, labels=["near", "far"])
    assert [ax.get_ylabel() for ax in page.axes][:2] == ["lift e (rad)", "reach e (m)"]
    assert "the 2 worst of 3 channels" in str(page.get_label())


@pytest.mark.parametrize(
    ("size", "unit", "factor"),
    [
        (3e-6, "µm", 1e6),
        (0.02, "mm", 1e3),
        (0.3, "m", 1.0),
    ],
)
def test_no_axis_has_an_exponent_and_its_numbers_are_in_its_unit(size, unit, factor):
    trace = duffing("classical")
    small = dataclasses.replace(
        trace, **{name: size * getattr(trace, name) for name in ("x", "r", "v", "s", "u")}
    )
    page = figure(small)
    page.draw_without_rendering()
    ax = shown(page, f"position x ({unit})")
    numbers = {}
    for text in ax.get_yticklabels():
        numbers[float(text.get_text().replace("−", "-"))] = float(text.get_position()[1])
    assert [value * factor for value in numbers.values()] == pytest.approx([*numbers])
    linear = []
    for axes in every(page):
        for axis in (axes.xaxis, axes.yaxis):
            if axis.get_scale() == "linear":
                linear.append(axis)
    assert not [axis.offsetText.get_text() for axis in linear if axis.offsetText.get_text()]


def test_shares_of_a_map_are_those_of_its_states_and_add_up():
    page = region_figure.draw_regions(basins())
    for ax, basin in zip(page.axes, basins(), strict=True):
        legend = ax.get_legend()
        assert legend is not None
        texts = [text.get_text() for text in legend.get_texts()]
        shares = {}
        for words, share in (text.split(": ") for text in texts):
            shares[words] = float(share.removesuffix(" %"))
        assert [*shares.values()] == pytest.approx([16.7, 16.7, 16.7, 16.7, 33.3])
        assert [re.findall(r"[\d.]+ s", words) for words in shares] == [
            ["2 s"],
            ["4 s"],
            ["8 s"],
            [],
            ["16 s"],
        ]
        (mesh,) = ax.collections
        assert np.ravel(mesh.get_array()).tolist() == [0, 1, 4, 2, 3, 4]
        colours = []
        for colour in mesh.get_cmap()(range(5)):
            colours.append(to_hex(colour))
        assert (
            colours[0]
            == colouring.ramp(colouring.law_colour(basin.law), 3, region_figure.LIGHTEST)[2].lower()
        )
        assert colours[4] == style.FAILED.lower(), "grey, not another law's orange"
        assert ax.get_title(loc="left") == wording.law_name(basin.law)
    assert page.legends[0].get_title().get_text() == "Van der Pol oscillator"
    assert "gains: tuned here" in [text.get_text() for text in page.texts + page.artists]


ONE, OTHER = (
    made(smc.Scenario(plant=name, law=smc.law("classical"), duration=0.01))
    for name in ("duffing", "van_der_pol")
)
REFUSED = {  # call -> arguments, and what replaces them
    figure: (
        {"traces": ONE},
        [
            {"traces": []},
            {"traces": [ONE, OTHER]},
            {"traces": [ONE, 3]},
            {"labels": ["a", "b"]},
            {"path": "a\0"},
            {"path": "a.gif"},
            {"path": "a.png", "format": "svg"},
            {"format": "svg"},
            {"size": (1.9, 5.0)},
            {"size": (5.0,)},
            {"size": (5.0, 4.0), "fig": Figure()},
            {"ax": Figure()},
            {"ax": Figure().add_subplot(), "size": "slide"},
            {"ax": Figure().add_subplot(), "panels": ["x", "u"]},
            {"ax": Figure().add_subplot(), "panels": ["tip"]},
            {"panels": ["y"]},
            {"panels": []},
        ],
    ),
    region_figure.draw_regions: ({"maps": []}, [{}]),
    smc.plot: ({"table": ONE}, [{}]),
    smc.show: ({"what": ONE}, [{}]),
    smc.film: (
        {
            "traces": ONE,
            "at": 0.0,
            "path": "a.png",
            "size": (320, 180),
        },
        [
            {"at": 0.02},
            {"at": None},
            {"path": "a.jpg"},
            {"path": "a.mp4"},
            {"size": (318, 180)},
            {"size": (481, 270)},
            {"span": (0.0, 1.0)},
            {
                "at": None,
                "path": "a.mp4",
                "span": (5.0, 6.0),
            },
            {"camera": (0.0, 91.0)},
            {"traces": [ONE] * 9},
            {"traces": []},
        ],
    ),
}


@pytest.mark.parametrize("call", REFUSED, ids=lambda call: call.__name__)
def test_what_cannot_be_drawn_is_refused(call, refused):
    arguments_given, changes = REFUSED[call]
    for change in changes:
        refused(lambda arguments=arguments_given | change: call(**arguments))


def test_a_free_body_has_the_errors_that_count_and_the_forces_of_its_actuators():
    """Its tilt follows from the force, and its actuators are not its channels."""
    traces = smc.run(
        [
            smc.Scenario(plant="quadrotor", law=law, duration=0.1)
            for law in ("geometric", "cascaded_pid")
        ]
    )
    labels = [panel.label for panel in panels.worst_first(traces)]
    assert sorted(labels) == ["body_rz e (rad)", "body_x e (m)", "body_y e (m)", "body_z e (m)"]
    actuator_panels = panels.actuators(traces)
    assert [panel.label for panel in actuator_panels] == [
        f"actuator {i} u (N)" for i in (1, 2, 3, 4)
    ]
    for i, panel in enumerate(actuator_panels):
        np.testing.assert_array_equal(panel.traces[0].u, traces[0].applied[:, i : i + 1])
    drawn = " ".join(ax.get_ylabel() for ax in figure(traces[0]).axes)
    assert sorted(map("".join, re.findall(r"actuator (\d)|\bu (\d)", drawn))) == [
        "1",
        "2",
        "3",
        "4",
    ]
    page = figure(traces)
    (together,) = [ax for ax in page.axes if ax.get_ylabel() == "control u (N)"]
    for row, trace in zip(together.child_axes, traces, strict=True):
        assert [len(line.get_ydata()) for line in row.lines] == [len(trace.t)] * 4
        for i, line in enumerate(row.lines):
            np.testing.assert_array_equal(line.get_ydata(), trace.applied[:, i])
    off = [dataclasses.replace(trace, applied=0.0 * trace.applied) for trace in traces]
    assert not [ax for ax in figure(off).axes if " u " in ax.get_ylabel()]
    assert "thin lines: the 4 actuators" in str(page.get_label())


def test_the_key_names_single_channels_only_where_they_differ():
    alike = arm()
    d = np.zeros_like(alike[0].d)
    d[20:40] = 5.0
    alike = [dataclasses.replace(trace, d=d) for trace in alike]
    assert d.shape[1] > 1
    assert "thin lines" not in str(figure(alike).get_label())
    d = d.copy()
    d[20:40, 1] = 4.0
    apart = [dataclasses.replace(trace, d=d) for trace in alike]
    assert "thin lines: the" in str(figure(apart).get_label())
