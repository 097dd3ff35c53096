"""The figure of an identification: a record beside what the twin predicts, and the residuals."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from smc_mujoco.common.errors import whole

if TYPE_CHECKING:
    from smc_mujoco.twins.identify import Identified

MEASURED, PREDICTED = "#444444", "#1f77b4"


def residual_figure(found: "Identified", path: str | Path, record: int = 0) -> list[Path]:
    """Draw each column of a record, measured and predicted, above its residual. Write PATH.svg and PATH.png."""
    from matplotlib.figure import Figure

    whole("record", record, 0, len(found.fits) - 1)
    predicted, measured, t = found.predictions[record]
    fit, names = found.fits[record], list(predicted)
    residuals = {name: measured[name] - predicted[name] for name in names}
    figure = Figure(figsize=(9.0, 2.6 * len(names)), layout="constrained")
    axes = np.atleast_2d(figure.subplots(len(names), 2, sharex=True, width_ratios=(3, 2)))
    for (left, right), name in zip(axes, names, strict=True):
        left.plot(t, measured[name], color=MEASURED, lw=1.0, label="measured")
        left.plot(t, predicted[name], color=PREDICTED, lw=1.0, label="twin")
        left.set_ylabel(name)
        left.set_title(f"fit {fit.get(name, fit.get('u', 0.0)):.1f} %", loc="left", fontsize=9)
        right.plot(t, residuals[name], color=PREDICTED, lw=0.7)
        right.axhline(0.0, color=MEASURED, lw=0.6)
        right.set_title(f"residual, rms {np.sqrt(np.mean(residuals[name] ** 2)):.3g}", loc="left", fontsize=9)
    axes[0][0].legend(frameon=False, fontsize=8, loc="upper right")
    for ax in axes[-1]:
        ax.set_xlabel("t (s)")
    figure.suptitle(found.rig.label, fontsize=10)
    base = Path(path).with_suffix("")
    base.parent.mkdir(parents=True, exist_ok=True)
    written = [base.with_suffix(ending) for ending in (".svg", ".png")]
    for file in written:
        figure.savefig(file, dpi=150)
    return written
