"""The figure of pairs of speed and torque: the points, the friction that is taken with its error,
and the other models.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from smc_mujoco.common.aliases import AnyPath, Array, ArrayPair, Fields
from smc_mujoco.draw import colouring, style
from smc_mujoco.draw import page as pages

HEIGHT = 4.2  # inches, of the panel
SPEEDS = 200  # of a curve, on each side of 0
Curve = Callable[[Array], Array]  # of speeds, (K,)


def pairs_figure(
    pairs: ArrayPair,
    forces: Mapping[str, Curve],
    taken: str,
    error: Curve,
    title: str,
    path: AnyPath,
) -> list[Path]:
    """Write PATH.svg and PATH.png, or PATH.pdf, and return the paths.

    Args:
      pairs: speeds and torques, (K,) each.
      forces: model -> its friction.
      taken: the model that is taken.
      error: the standard error of its friction.
      title: of the panel.
    """
    paths = pages.files(path)
    v, torque = pairs
    colour, *more = colouring.spread(len(forces))
    looks = _looks(forces, taken, more)
    handles: list[Line2D | Patch] = [
        Line2D([], [], ls="", marker=".", color=style.INK, label="pairs"),
        Line2D([], [], color=colour, lw=1.8, label=f"taken: {taken}"),
        Patch(color=colour, alpha=0.25, lw=0.0, label="± 2 standard errors"),
    ]
    for model, look in looks.items():
        handles.append(Line2D([], [], label=model, **look))
    side = np.linspace(1e-3, 1.0, SPEEDS)
    with style.page():
        height = pages.head_height(style.FULL_WIDTH, handles) + HEIGHT
        page = pages.blank(style.FULL_WIDTH, height)
        ax = page.subplots()
        ax.plot(v, torque, ".", ms=2.5, color=style.INK, alpha=0.35)
        for speeds in (side[::-1] * v.min(), side * v.max()):
            for model, look in looks.items():
                ax.plot(speeds, forces[model](speeds), **look)
            curve = forces[taken](speeds)
            wide = 2.0 * error(speeds)
            ax.plot(speeds, curve, color=colour, lw=1.8)
            ax.fill_between(speeds, curve - wide, curve + wide, color=colour, alpha=0.25, lw=0.0)
        ax.set_xlabel("speed (rad/s or m/s)")
        ax.set_ylabel("torque (N·m or N)")
        ax.set_title(title)
        pages.set_head(page, style.FULL_WIDTH, "Friction from speed and torque", handles)
        pages.write_page(page, paths)
    return paths


def _looks(models: Iterable[str], taken: str, colours: Sequence[str]) -> dict[str, Fields]:
    """Return the look of the line of each model that is not taken."""
    looks: dict[str, Fields] = {}
    for model in models:
        if model == taken:
            continue
        place = len(looks)
        dashes = style.DASHES[(place + 1) % len(style.DASHES)]
        looks[model] = {"color": colours[place], "lw": 1.2, "ls": dashes}
    return looks
