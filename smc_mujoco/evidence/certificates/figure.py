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
from smc_mujoco.evidence.certificates import loops
from smc_mujoco.mechanisms.named import as_plant
from smc_mujoco.mechanisms.plant import EFFORT
from smc_mujoco.simulation.trace import Trace

FIGURE_SIZE = (8.8, 4.8)  # inches
ZOOM_BOUNDS = 2.5  # half-width of the second panel as a multiple of the bound: chosen
AXIS_POINTS = 801  # points of the plane in each direction
LIGHTEST, FADED = (
    82.0,
    0.75,
)  # lightness of the innermost level, in CIELAB; share of paper in the region's colour: chosen
LEVELS = 7  # lines between the inner and the outer level, or of V: chosen


def draw(
    certificate: Any,
    traces: Sequence[Trace] = (),
    path: str | os.PathLike[str] | None = None,
    worst_of: int = 0,
) -> Any:
    """Draw a certificate's state plane; see `Certificate.figure`."""
    data = certificate.data
    unit = certificate.data["unit"]
    if data["plant"]["n"] > 1:
        raise ScenarioError(
            f"the states of {data['plant']['n']} pendulums do not fit into a plane: draw a single one"
        )
    part = next((one for one in data["parts"] if one["theorem"] == "level sets"), None)
    if part is None and not certificate.stable:
        raise ScenarioError(
            f"the certificate of {certificate.law} on {certificate.plant} has no region to draw"
        )
    paths = pages.files(path)
    law = style.law_colour(certificate.law)
    shades = style.ramp(law, 3, LIGHTEST)
    bounded = part is not None and not certificate.rests
    width = FIGURE_SIZE[0] if bounded else 0.62 * FIGURE_SIZE[0]
    height = FIGURE_SIZE[1]
    with style.page(FIGURE_SIZE[0]):
        page = pages.blank(width, height, None)
        axes = page.subplots(1, 2 if bounded else 1, squeeze=False).ravel()
        x, v = _plane(certificate, part, traces)
        for ax, zoom in zip(
            axes, (1.0, ZOOM_BOUNDS * (part["bound"] if part else 0.0) / x[-1]), strict=False
        ):
            X, V = np.meshgrid(x * zoom, v * zoom ** (0.5 if zoom < 1.0 else 1.0))
            if part is None:
                _energy(ax, certificate, X, V, style.ramp(law, LEVELS))
            else:
                _region(ax, certificate, part, X, V, shades)
            for trace in traces:
                ax.plot(trace.x[:, 0], trace.v[:, 0], color=law, linewidth=style.points(1.8))
                ax.plot(
                    trace.x[0, 0], trace.v[0, 0], "o", color=style.INK, markersize=style.points(5)
                )
            ax.set(
                xlim=X[0, [0, -1]],
                ylim=V[[0, -1], 0],
                xlabel=f"position ({unit})",
                ylabel=f"velocity ({unit}/s)",
            )
        if data["disturbance"]:
            under = f", |d| ≤ {data['disturbance']:g} {EFFORT[unit]}"
        else:
            under = ""
        plant = style.plant_name(as_plant(certificate.plant), short=True)
        if bounded:
            axes[1].set_title("around the bound")
        handles = _key(certificate, part, shades)
        handles += [
            Line2D([], [], color=law, label=_run_words(trace, unit, worst_of)) for trace in traces
        ]
        pages.set_head(
            page, width, f"Certificate: {style.law_name(certificate.law)}, {plant}{under}", handles
        )
        pages.write(page, paths)
    return page


def _plane(certificate: Any, part: Any, traces: Sequence[Trace]) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities around the region, or around the runs."""
    ends = []
    for trace in traces:
        if np.isfinite(trace.x).all():
            ends.append((np.abs(trace.x).max(), np.abs(trace.v).max()))
    far_x, far_v = np.max([(1e-3, 1e-3), *ends], axis=0)
    if part is not None:
        X, S = np.meshgrid(np.array(part["x"]), np.array(part["s"]), indexing="ij")
        inside = np.array(part["W"]) <= part["outer"]
        far_x = max(far_x, np.abs(X[inside]).max())
        far_v = max(far_v, np.abs(S - certificate.surface * X)[inside].max())
    elif not ends:
        far_x = 2.0
        far_v = 6.0
    return np.linspace(-1.08 * far_x, 1.08 * far_x, AXIS_POINTS), np.linspace(
        -1.08 * far_v, 1.08 * far_v, AXIS_POINTS
    )


def _region(
    ax: Any, certificate: Any, part: Any, X: np.ndarray, V: np.ndarray, shades: Sequence[str]
) -> None:
    """Fill the region, and draw its levels and the bound."""
    W, (light, middle, dark) = certificate.level(X, V), shades
    levels = np.linspace(part["inner"], part["outer"], LEVELS)
    ax.contourf(X, V, W, [-1.0, part["outer"]], colors=[style.mixed(light, style.PAPER, FADED)])
    ax.contour(X, V, W, levels[1:-1], colors=[middle], linewidths=style.points(0.7))
    ax.contour(X, V, W, levels[-1:], colors=[dark], linewidths=style.points(1.6))
    ax.contourf(X, V, W, [-1.0, part["inner"]], colors=[light], antialiased=True)
    ax.contour(X, V, W, levels[:1], colors=[dark], linewidths=style.points(1.0))
    for side in () if certificate.rests else (-1.0, 1.0):
        ax.axvline(
            side * part["bound"],
            color=style.INK,
            linewidth=style.points(0.8),
            linestyle=(0, (4, 3)),
        )


def _energy(ax: Any, certificate: Any, X: np.ndarray, V: np.ndarray, shades: Sequence[str]) -> None:
    """Draw level sets of V, darker from which the runs come sooner: from the outer ones."""
    value = loops.energy(certificate.data, X, V)
    top = float(
        loops.energy(certificate.data, X[:1, -1:], 0.0 * X[:1, -1:])[0, 0]
    )  # the energy at rest at the edge
    ax.contour(
        X,
        V,
        value,
        top * np.linspace(0.15, 1.0, LEVELS) ** 2,
        colors=shades,
        linewidths=style.points(1.2),
    )


def _key(certificate: Any, part: Any, shades: Sequence[str]) -> list[pages.Handle]:
    """Return what the areas and the lines of the plane are."""
    light, middle, dark = shades
    if part is None:
        return [Line2D([], [], color=middle, label="level sets of V, which never rises without d")]
    ends = f"ends in |x| ≤ {part['bound']:.3g} {certificate.data['unit']}"
    told = "certified: " + ("comes to rest" if certificate.rests else ends)
    handles: list[pages.Handle] = [
        Patch(facecolor=style.mixed(light, style.PAPER, FADED), edgecolor=dark, label=told),
        Line2D([], [], color=middle, label="level sets of W, which falls"),
        Patch(facecolor=light, edgecolor=dark, label="innermost level"),
    ]
    bound = [Line2D([], [], color=style.INK, linestyle=(0, (4, 3)), label="bound")]
    return handles + bound * (not certificate.rests)


def _run_words(trace: Trace, unit: str, worst_of: int) -> str:
    """Return what a run is, with the range of its disturbance."""
    low = trace.d.min()
    high = trace.d.max()
    if low < high:
        drawn = f"d from {low:.3g} to {high:.3g}"
    else:
        drawn = f"d = {low:.3g}"
    if worst_of:
        what = f"the worst of {worst_of} runs"
    else:
        what = "run"
    return f"{what}, {drawn} {EFFORT[unit]}".replace("-", "−")
