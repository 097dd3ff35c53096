"""The figure of docs/what_wins_under_friction.md: errors through reversals, and runs to rest."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.patches import Patch

import smc_mujoco as smc
from benchmarks.friction import LAWS, RATES, Case, Told, law_of
from benchmarks.friction_plants import joints
from smc_mujoco.draw import page, style

JOINTS = ("rail", "geared")
FRICTION = "coulomb30"  # of the reversals
RESTS = ("pid", "hodob", "pd_observer", "super_twisting", "boundary_layer")
SHOWN, LASTS = 2.0, 20.0  # s of a run to rest
WIDTH, HEIGHT = 6.4, 6.2  # inches


def found(points: Sequence[dict], **about) -> dict | None:
    """Return the first point of this description."""
    return next((point for point in points if about.items() <= point.items()), None)


def of_reversals(ax, points: Sequence[dict], joint: str, colours: dict[str, str]) -> None:
    """Draw the errors of all laws on a joint: a line from the low price to the high one, a diamond
    for the right feedforward, and a bar between 30 % off either way.
    """
    for place, law in enumerate(LAWS):
        colour = colours[law]
        its = {"joint": joint, "law": law, "price": "R", "friction": FRICTION}
        errors = {}
        for level, share in (
            (RATES[0], 0.0),
            (RATES[1], 0.0),
            *((RATES[0], s) for s in (1, 0.7, 1.3)),
        ):
            point = found(points, **its, level=level, share=float(share))
            if point and point["errors"]:
                errors[level, float(share)] = np.median(point["errors"])
        plain = [errors[level, 0.0] for level in RATES[:2] if (level, 0.0) in errors]
        ax.plot(plain, [place] * len(plain), color=colour, lw=1.2)
        for level, fill in zip(RATES[:2], ("white", colour), strict=True):
            if (level, 0.0) in errors:
                ax.plot(errors[level, 0.0], place, "o", ms=5, mec=colour, mfc=fill)
        wrong = [errors[RATES[0], share] for share in (0.7, 1.3) if (RATES[0], share) in errors]
        if len(wrong) == 2:
            ax.plot(wrong, [place + 0.25] * 2, color=colour, lw=4, alpha=0.35)
        if (RATES[0], 1.0) in errors:
            ax.plot(errors[RATES[0], 1.0], place + 0.25, "D", ms=4, color=colour)


def of_rest(ax, points: Sequence[dict], joint: str, colours: dict[str, str]) -> None:
    """Draw runs of MuJoCo to rest under Stribeck friction, with the gains of the least J."""
    one = joints()[joint]
    for law in reversed(RESTS):  # what chatters lies below
        point = found(points, joint=joint, law=law, price="J", friction="stribeck")
        if not point or not point["errors"]:
            continue
        names = tuple(point["gains"])[:-1]
        told = Told(one, law, law_of(law, one), names)
        gains = list(point["gains"].values())
        trace = smc.run(told.scenario(gains, Case("stribeck"), 1, length=LASTS))
        late = trace.t >= SHOWN
        look = {"color": colours[law], "ls": style.DASHES[RESTS.index(law)]}
        ax.plot(trace.t[late], trace.e[late, 0] / one.count, lw=1.0, **look)


def key(colours: dict[str, str]) -> list[page.Handle]:
    """Return the legend's entries: laws of the runs to rest, then marks of the reversals."""
    handles: list[page.Handle] = []
    for law, dashes in zip(RESTS, style.DASHES, strict=False):
        handles.append(page.entry(name_of(law), colours[law], lw=1.5, ls=dashes))
    low, high, _ = RATES
    dot = {"marker": "o", "ms": 5, "ls": ""}
    handles.append(page.entry(f"no compensation, R {low:g}", mfc=style.PAPER, **dot))
    handles.append(page.entry(f"no compensation, R {high:g}", **dot))
    handles.append(page.entry(f"right compensation, R {low:g}", marker="D", ms=4, ls=""))
    handles.append(page.entry("30 % too small to too large", lw=4, alpha=0.35))
    handles.append(Patch(color=style.BAND, label="below one count"))
    return handles


def draw(points: Sequence[dict], path: Path) -> None:
    """Draw the figure: a column a joint."""
    known = [law for law in LAWS if law != "pd"]
    by_law = {"pd": style.MUTED} | dict(zip(known, style.law_colours(known), strict=True))
    with style.page(WIDTH):
        handles = key(by_law)
        head = page.head_height(WIDTH, handles)
        figure = page.blank(WIDTH, HEIGHT + head, None)
        panels = figure.subplots(2, len(JOINTS), squeeze=False, height_ratios=(1.5, 1.0))
        for column, joint in enumerate(JOINTS):
            top, below = panels[0][column], panels[1][column]
            of_reversals(top, points, joint, by_law)
            top.axvspan(1e-3, 1.0, color=style.BAND, lw=0, zorder=0)
            top.set(xscale="log", xlim=(0.3, 300.0), xlabel="rms error (counts)")
            top.set_yticks(range(len(LAWS)), [name_of(law) for law in LAWS] if column == 0 else [])
            top.set_ylim(len(LAWS) - 0.4, -0.6)
            top.set_title(f"{joint}\nreversals, Coulomb 30 %")
            of_rest(below, points, joint, by_law)
            below.set(xlim=(SHOWN, LASTS), xlabel="time (s)")
            below.set_title("to rest, Stribeck, gains by J", weight="normal")
        panels[1][0].set_ylabel("error (counts)")
        page.set_head(figure, WIDTH, "Laws under friction", handles)
        page.write(figure, page.files(path, "svg"))


def name_of(law: str) -> str:
    """Return the name of a law in the figure."""
    return "PD" if law == "pd" else style.law_name(law)
