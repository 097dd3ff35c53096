"""The figure of docs/what_wins_under_friction.md: errors through reversals, and runs to rest."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Patch

import smc_mujoco as smc
from benchmarks.friction import LAWS, RATES, Case, Told, law_of
from benchmarks.friction_plants import joints
from smc_mujoco.draw import decimate, page, style
from smc_mujoco.simulation.trace import Trace

JOINTS = ("rail", "geared")
FRICTION = "coulomb30"  # of the reversals
RESTS = ("pid", "hodob", "pd_observer", "super_twisting", "boundary_layer")
SHOWN, LASTS = 2.0, 20.0  # s of a run to rest
LEAST, MOST = 0.3, 300.0  # counts, ends of the axis of the reversals
FAR = 200.0  # counts, ends of the axis of a run to rest
LANE_TICKS = [-10.0, -1.0, 1.0, 10.0]  # counts; between the middle two the axis is linear
WIDTH, ROW, LANE = 4.8, 0.24, 0.36  # inches: letters are read on a phone
NAMES = 94.0  # points, the width of the laws' names
RING = {"marker": "o", "ms": 7.0, "ls": ""}  # of the low R, so that equal errors are a target
DISC = {"marker": "o", "ms": 3.5, "ls": ""}  # of the high R
REVERSALS, REST = "Reversals, Coulomb 30 %", "To rest, Stribeck"
RIGHT = {"marker": "D", "ms": 4.5, "mec": style.PAPER, "mew": 0.5, "ls": ""}  # seen on its bar
WRONG = {"lw": 3.0, "solid_capstyle": "projecting"}  # so that equal errors have a square
WORDS = {  # no line of the grid is seen through them
    "va": "center",
    "fontsize": "small",
    "color": style.MUTED,
    "bbox": {"fc": style.PAPER, "ec": "none", "pad": 0.5},
}
R_IN_WORDS = "R: variation of u at rest, bounds/s"

Errors = dict[tuple[float, float], float]  # level of R and share of compensation -> counts


def found(points: Sequence[dict], **about) -> dict | None:
    """Return the first point of this description."""
    return next((point for point in points if about.items() <= point.items()), None)


def errors_of(points: Sequence[dict], joint: str, law: str) -> Errors:
    """Return the median errors through reversals at each level of R, and with compensation."""
    its = {"joint": joint, "law": law, "price": "R", "friction": FRICTION}
    errors: Errors = {}
    plain = [(level, 0.0) for level in RATES]
    for level, share in (*plain, *((RATES[0], share) for share in (1.0, 0.7, 1.3))):
        point = found(points, **its, level=level, share=share)
        if point and point["errors"]:
            errors[level, share] = float(np.median(point["errors"]))
    return errors


def why_empty(errors: Errors) -> str:
    """Return why a row has no mark; "" if it has one."""
    low, high, highest = RATES
    if (low, 0.0) in errors or (high, 0.0) in errors:
        return ""
    if (highest, 0.0) in errors:
        return f"gains only at R {highest:g}"
    return "no gains admitted"


def of_law(ax: Axes, place: float, errors: Errors, colour: str) -> None:
    """Draw a law's errors: a line from the low R to the high one, an arrow for what is beyond the
    axis, a diamond for the right compensation, and a bar between 30 % off either way, tied to it.
    """
    low, high, _ = RATES
    plain = [errors[level, 0.0] for level in (low, high) if (level, 0.0) in errors]
    above, below = place - 0.15, place + 0.2
    ax.plot(plain, [above] * len(plain), color=colour, lw=1.2)
    for level, look in ((low, {"mfc": style.PAPER, **RING}), (high, {"mfc": colour, **DISC})):
        error = errors.get((level, 0.0), 0.0)
        if error > MOST:
            ax.plot(MOST, above, ">", ms=4, color=colour, clip_on=False)
            ax.text(1.4 * MOST, above, f"{error:.0f}", WORDS)
        elif error:
            ax.plot(error, above, mec=colour, **look)
    wrong = [errors[low, share] for share in (0.7, 1.3) if (low, share) in errors]
    if (low, 1.0) in errors:
        right = errors[low, 1.0]
        ax.plot([right, *wrong], [below] * (1 + len(wrong)), color=colour, lw=0.8)
        ax.plot(wrong, [below] * len(wrong), color=colour, **WRONG)
        ax.plot(right, below, color=colour, zorder=3, **RIGHT)
    if words := why_empty(errors):
        ax.text(1.3, place, words, WORDS)


def to_rest(points: Sequence[dict], joint: str, law: str) -> Trace:
    """Return MuJoCo's run to rest under Stribeck friction, with the gains of the least J."""
    one = joints()[joint]
    point = found(points, joint=joint, law=law, price="J", friction="stribeck")
    assert point is not None
    told = Told(one, law, law_of(law, one), tuple(point["gains"])[:-1])
    gains = list(point["gains"].values())
    return smc.run(told.scenario(gains, Case("stribeck"), 1, length=LASTS))


def of_rest(ax: Axes, trace: Trace, count: float, colour: str) -> None:
    """Draw the error of a run to rest in counts; where it chatters, its mean and its range."""
    late = trace.t >= SHOWN
    t, error = trace.t[late], trace.e[late, 0] / count
    width = decimate.window(trace)
    if decimate.chattering_parts(error, width):
        at, low, high = decimate.band(t, error[:, None])
        ax.fill_between(at, low, high, color=colour, alpha=0.3, lw=0)
    ax.plot(*decimate.line(t, error, width), color=colour, lw=1.2)
    if np.abs(error).min() > 10.0:
        where = f"rests at {error[-1]:.0f}".replace("-", "−")
        ax.text(LASTS - 0.5, -10.0 * np.sign(error[-1]), where, WORDS, ha="right")
    ax.axhspan(-1.0, 1.0, color=style.BAND, lw=0, zorder=0)
    ax.set_yscale("symlog", linthresh=1.0)
    ax.set(xlim=(SHOWN, LASTS), ylim=(-FAR, FAR))
    ax.set_yticks(LANE_TICKS, ["−10", "", "", "10"])
    ax.minorticks_off()


def key() -> list[page.Handle]:
    """Return the legend's entries."""
    low, high, _ = RATES
    return [
        page.entry(f"no compensation, R {low:g}", mfc=style.PAPER, **RING),
        page.entry(f"no compensation, R {high:g}", **DISC),
        page.entry(f"right compensation, R {low:g}", **RIGHT),
        page.entry("30 % too small to too large", **WRONG),
        Patch(color=style.BAND, label="below one count, log beyond"),
    ]


def drawn(points: Sequence[dict], rests: Mapping[tuple[str, str], Trace]) -> Figure:
    """Return the figure: a column a joint, a row a law; `rests` has the runs by joint and law."""
    known = [law for law in LAWS if law != "pd"]
    colours = {"pd": style.MUTED} | dict(zip(known, style.law_colours(known), strict=True))
    with style.page(WIDTH):
        heights = [ROW * len(LAWS), *[LANE] * len(RESTS)]
        height = page.head_height(WIDTH, key()) + sum(heights) + 1.4
        figure = page.blank(WIDTH, height, None)
        layout = figure.get_layout_engine()
        assert isinstance(layout, ConstrainedLayoutEngine)
        layout.set(h_pad=0.03)
        panels = figure.subplots(len(heights), len(JOINTS), squeeze=False, height_ratios=heights)
        for joint, (top, *lanes) in zip(JOINTS, panels.T, strict=True):
            for place, law in enumerate(LAWS):
                of_law(top, place, errors_of(points, joint, law), colours[law])
            top.axvspan(LEAST, 1.0, color=style.BAND, lw=0, zorder=0)
            top.set(xscale="log", xlim=(LEAST, MOST), xlabel="rms error (counts)")
            top.set_yticks(range(len(LAWS)), [""] * len(LAWS))
            top.set_ylim(len(LAWS) - 0.5, -0.5)
            top.set_title(joint)
            for law, lane in zip(RESTS, lanes, strict=True):
                of_rest(lane, rests[joint, law], joints()[joint].count, colours[law])
                lane.set_xticks([5, 10, 15, 20], [""] * 4)
                lane.tick_params(axis="x", length=0.0)
            lanes[0].set_title(f"{joint} (counts)")
            lanes[-1].set_xticks([5, 10, 15, 20], ["5", "10", "15", "20"])
            lanes[-1].set_xlabel("time (s)")
        panels[0][0].set_yticklabels(map(name_of, LAWS))
        for law, lane in zip(RESTS, panels[1:, 0], strict=True):
            look = {"rotation": 0, "ha": "right", "va": "center", "color": style.MUTED}
            lane.set_ylabel(name_of(law), fontsize=style.points(9.5), **look)
        for ax, words in ((panels[0][0], REVERSALS), (panels[1][0], REST)):
            look = {"ha": "right", "textcoords": "offset points"}
            ax.annotate(words, (0.0, 1.0), (-8.0, 5.0), "axes fraction", **look)
        for lane in panels[1:, 1]:
            lane.set_yticks(LANE_TICKS, [""] * 4)
        page.set_head(figure, WIDTH, "Laws under friction", key(), R_IN_WORDS)
    assert isinstance(figure, Figure)
    return figure


def draw(points: Sequence[dict], path: Path) -> None:
    """Write the figure to a file."""
    rests = {}
    for joint in JOINTS:
        for law in RESTS:
            rests[joint, law] = to_rest(points, joint, law)
    page.write(drawn(points, rests), page.files(path, "svg"))


def name_of(law: str) -> str:
    """Return the name of a law in the figure, on up to two lines."""
    name = "PD" if law == "pd" else style.law_name(law)
    return style.wrapped(name, NAMES, style.points(9.5), lines=2)
