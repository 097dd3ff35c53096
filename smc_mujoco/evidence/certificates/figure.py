"""The state plane of a certificate: region, level sets, bound and runs."""

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.draw import page as pages
from smc_mujoco.draw import style
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import EFFORT
from smc_mujoco.simulation.trace import Trace

FIGURE_SIZE = (8.8, 4.8)  # inches
ZOOM_BOUNDS = 2.5  # half-width of the second panel as a multiple of the bound: chosen
AXIS_POINTS = 801  # points of the plane in each direction
LIGHTEST = 82.0  # lightness of the innermost level, in CIELAB: chosen
FADED = 0.75  # share of paper in the region's colour: chosen
LEVELS = 7  # lines between the inner and the outer level: chosen


def draw(
    certificate: Any,
    traces: Sequence[Trace] = (),
    path: str | os.PathLike[str] | None = None,
    worst_of: int = 0,
) -> Any:
    """Draw a certificate's state plane; see `Certificate.figure`."""
    data = certificate.data
    unit = data["unit"]
    part = next((one for one in data["parts"] if one["theorem"] == "level sets"), None)
    if part is None:
        raise ScenarioError(
            f"the certificate of {certificate.law} on {certificate.plant} has no level sets to "
            "draw: certify one channel under a disturbance"
        )
    paths = pages.files(path)
    law = style.law_colour(certificate.law)
    light, middle, dark = style.ramp(law, 3, LIGHTEST)
    faded = style.mixed(light, style.PAPER, FADED)
    bound = Line2D([], [], color=style.INK, linestyle="--", label="bound")
    handles: list[pages.Handle] = [
        Patch(facecolor=faded, edgecolor=dark, label="certified"),
        Line2D([], [], color=middle, label="level sets of W, which falls"),
        Patch(facecolor=light, edgecolor=dark, label="innermost level"),
    ]
    halves = [_half_plane(certificate, part, traces)]
    if not certificate.rests:
        handles.append(bound)
        near = ZOOM_BOUNDS * part["bound"] / halves[0][0]
        halves.append(halves[0] * np.array([near, near**0.5]))
    words = f"worst of {worst_of} runs" if worst_of else "run"
    handles += [Line2D([], [], color=law, label=words) for _ in traces]
    width = FIGURE_SIZE[0] * (0.62 if certificate.rests else 1.0)
    levels = np.linspace(part["inner"], part["outer"], LEVELS)
    with style.page(FIGURE_SIZE[0]):
        page = pages.blank(width, FIGURE_SIZE[1], None)
        axes = page.subplots(1, len(halves), squeeze=False).ravel()
        for ax, (far_x, far_v) in zip(axes, halves, strict=True):
            x = np.linspace(-far_x, far_x, AXIS_POINTS)
            v = np.linspace(-far_v, far_v, AXIS_POINTS)
            X, V = np.meshgrid(x, v)
            W = certificate.level(X, V)
            ax.contourf(X, V, W, [-1.0, levels[-1]], colors=[faded])
            ax.contour(X, V, W, levels[1:-1], colors=[middle], linewidths=style.points(0.7))
            ax.contour(X, V, W, levels[-1:], colors=[dark], linewidths=style.points(1.6))
            ax.contourf(X, V, W, [-1.0, levels[0]], colors=[light])
            ax.contour(X, V, W, levels[:1], colors=[dark], linewidths=style.points(1.0))
            if not certificate.rests:
                for side in (-1.0, 1.0):
                    ax.axvline(side * part["bound"], color=style.INK, linestyle="--")
            for trace in traces:
                ax.plot(trace.x[:, 0], trace.v[:, 0], color=law, linewidth=style.points(1.8))
                ax.plot(trace.x[0, 0], trace.v[0, 0], "o", color=style.INK, ms=style.points(5))
            ax.set(
                xlim=(-far_x, far_x),
                ylim=(-far_v, far_v),
                xlabel=f"position ({unit})",
                ylabel=f"velocity ({unit}/s)",
            )
        title = (
            f"{style.law_name(certificate.law)}, {style.plant_name(as_plant(certificate.plant))}"
        )
        if data["disturbance"]:
            title += f", |d| ≤ {data['disturbance']:g} {EFFORT[unit]}"
        pages.set_head(page, width, title, handles)
        pages.write(page, paths)
    return page


def _half_plane(certificate: Any, part: Any, traces: Sequence[Trace]) -> np.ndarray:
    """Return the largest position and velocity of the region and of the runs, with a margin."""
    X, S = np.meshgrid(part["x"], part["s"], indexing="ij")
    inside = np.array(part["W"]) <= part["outer"]
    ends = [(np.abs(X[inside]).max(), np.abs(S - certificate.surface * X)[inside].max())]
    for trace in traces:
        if np.isfinite(trace.x).all():
            ends.append((np.abs(trace.x).max(), np.abs(trace.v).max()))
    return 1.08 * np.max(ends, axis=0)
