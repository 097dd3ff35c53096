"""The figure of a record beside what twins predict, and their residuals."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from smc_mujoco.evidence.rigs.records import Record

MEASURED = "#444444"
PREDICTED = ("#1f77b4", "#d55e00", "#009e73", "#cc79a7")  # colours that the colour-blind can tell apart


def residual_figure(
    title: str,
    t: np.ndarray,
    measured: Record,
    predicted: Mapping[str, Record],
    fits: Mapping[str, Mapping[str, float]],
    units: Mapping[str, str],
    path: str | Path,
) -> list[Path]:
    """Draw each column of a record, measured and predicted, beside its residuals. Write PATH.svg and PATH.png.

    Args:
      title: of the figure.
      t: times, s, (K,).
      measured: column -> values, (K,).
      predicted, fits: name of a twin -> what it predicts, and its fit of each column, percent.
      units: column -> its unit.
      path: of the files; its ending is replaced.

    Returns:
      The paths of both files.
    """
    from matplotlib.figure import Figure

    names = list(measured)
    figure = Figure(figsize=(9.0, 2.6 * len(names)), layout="constrained")
    axes = np.atleast_2d(figure.subplots(len(names), 2, sharex=True, width_ratios=(3, 2)))
    for k, ((left, right), name) in enumerate(zip(axes, names, strict=True)):
        left.plot(t, measured[name], color=MEASURED, lw=1.6, label="measured")
        reached, left_over = [], []
        for (twin, columns), colour in zip(predicted.items(), PREDICTED * len(predicted), strict=False):
            residual = measured[name] - columns[name]
            left.plot(t, columns[name], color=colour, lw=0.9, label=twin)
            right.plot(t, residual, color=colour, lw=0.7)
            reached.append(f"{twin} {list(fits[twin].values())[k]:.1f} %")
            left_over.append(f"{twin} {np.sqrt(np.mean(residual**2)):.3g}")
        left.set_ylabel(f"{name} ({units[name]})")
        left.set_title(f"fit: {', '.join(reached)}", loc="left", fontsize=9)
        right.axhline(0.0, color=MEASURED, lw=0.6)
        right.set_title(f"residual, rms: {', '.join(left_over)}", loc="left", fontsize=9)
    figure.legend(
        *axes[0][0].get_legend_handles_labels(), ncols=5, frameon=False, fontsize=8, loc="outside lower center"
    )
    for ax in axes[-1]:
        ax.set_xlabel("t (s)")
    figure.suptitle(title, fontsize=10)
    base = Path(path).with_suffix("")
    base.parent.mkdir(parents=True, exist_ok=True)
    written = [base.with_suffix(ending) for ending in (".svg", ".png")]
    for file in written:
        figure.savefig(file, dpi=150)
    return written
