"""Maps of regions of attraction: blue where a law brings the plant to rest, the sooner the darker."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from smc_mujoco.analysis.region_of_attraction import CONVERGES, DOES_NOT, Basin
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import replacing
from smc_mujoco.draw import style

ENDINGS = (".png", ".svg")
# From soon to late, then undecided, then not: different in lightness alone, so also with colour blindness and in grey.
# Blue and orange are those of Okabe and Ito.
BLUES, OPEN, NOT = ("#00466B", "#0072B2", "#7CC0E8"), "#F4F4F4", "#F2B84B"


def checked(path: str | os.PathLike) -> Path:
    """Return the path, if its ending is that of a picture."""
    path = Path(path)
    if path.suffix not in ENDINGS or "\0" in path.name:
        raise ScenarioError(f"cannot draw to {str(path)!r}: end the name in {' or '.join(ENDINGS)}")
    return path


def draw(maps: Sequence[Basin], path: str | os.PathLike) -> Path:
    """Draw maps side by side, to a .png or .svg file.

    Raises:
      ScenarioError: another kind of file, or no maps.
    """
    from matplotlib.figure import Figure

    path = checked(path)
    if not maps:
        raise ScenarioError("no map to draw: give at least one")
    with style.page():
        figure = Figure(figsize=(5.4 * len(maps), 5.3), layout="constrained")
        for ax, region in zip(np.atleast_1d(figure.subplots(1, len(maps))), maps, strict=True):
            fill(ax, region)
        with replacing(path) as file:
            figure.savefig(file, dpi=150, metadata={"Date": None} if path.suffix == ".svg" else None)
    return path


def fill(ax, region: Basin) -> None:
    """Fill a matplotlib axes with a map and its legend."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    classes, entries = classed(region)
    ax.pcolormesh(region.x, region.v, classes, cmap=ListedColormap([*BLUES, OPEN, NOT]), vmin=-0.5, vmax=4.5)
    ax.plot(0.0, 0.0, "+", color=style.PAPER, markersize=11, markeredgewidth=1.6)
    ax.grid(visible=False)
    ax.set_title(f"{style.law_name(region.law)} on {region.plant.replace('_', ' ')}")
    ax.set_xlabel(f"initial position ({region.unit})")
    ax.set_ylabel(f"initial velocity ({region.unit}/s)")
    marks = [Patch(facecolor=colour, edgecolor=style.RULE, label=words) for colour, words in entries]
    ax.legend(handles=marks, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2, fontsize=9.5)


def classed(region: Basin) -> tuple[np.ndarray, list[tuple[str, str]]]:
    """Return the number of each state's colour, (nv, nx), and the colours that occur with their meaning."""
    classes = np.where(region.outcome == DOES_NOT, 4, 3)
    horizons = np.unique(region.decided_at[region.outcome == CONVERGES])
    names = {3: "undecided", 4: "does not"}
    for i, horizon in enumerate(horizons):
        shade = min(i, len(BLUES) - 1)
        classes[(region.outcome == CONVERGES) & (region.decided_at == horizon)] = shade
        names[shade] = f"comes to rest, by {horizon:.3g} s"
    shares = {k: (classes == k).mean() for k in range(5)}
    colours = (*BLUES, OPEN, NOT)
    return classes, [(colours[k], f"{names[k]}: {100 * shares[k]:.3g} %") for k in range(5) if shares[k]]
