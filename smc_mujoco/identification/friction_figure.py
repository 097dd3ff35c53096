"""The figure of an identified machine: for each joint its log beside the open-loop prediction, the
residual over speed, and the friction with its error over the forces of the log.
"""

import dataclasses
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from smc_mujoco.common.aliases import AnyPath, Array, Numbers
from smc_mujoco.draw import colouring, lettering, shared_axes, style
from smc_mujoco.draw import page as pages
from smc_mujoco.identification import first_guess, records
from smc_mujoco.identification.inverse_dynamics import COMPARED_PERIOD
from smc_mujoco.identification.log_rig import LogRig
from smc_mujoco.identification.paths import DELAY, steady_force
from smc_mujoco.identification.records import Record
from smc_mujoco.identification.rig import Values
from smc_mujoco.mechanisms.hardware.part import Actuator
from smc_mujoco.mechanisms.layout import channel_names, dof_ids
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.scenario import Scenario

ROW_HEIGHT = 2.5  # inches, height of a joint's panels
LOG_WIDTH = 2.4  # points, of a log, beside which dashes over it are seen in grey, too; chosen
DASHES = (0, (3, 2))
SPEEDS = 200  # of the friction's curve, on each side of 0
REACH = 0.1  # s around the start and each turn of a joint, over which forces below 5 Hz are smeared
SHOWN_SHARE = 0.98  # of the points, which are on the scale: single ones would set it; chosen


def friction_figure(
    rig: LogRig,
    covariance: Array,
    log: Record,
    prediction: tuple[Record, Record, Array],
    fit: Numbers,
    path: AnyPath,
) -> list[Path]:
    """Draw a log of a machine: measured and predicted positions, residuals, frictions. Write
    PATH.svg and PATH.png.

    `covariance`: of the errors of the rig's `free` quantities, (p, p). `prediction`: predicted and
    measured columns of the log, and their times.
    """
    predicted, measured, t = prediction
    paths = pages.files(path)
    colour = colouring.spread(1)[0]
    handles = [
        Line2D([], [], color=style.INK, lw=LOG_WIDTH, label="log"),
        Line2D([], [], color=colour, ls=DASHES, label="found, replayed from the commands"),
        Line2D([], [], color=colour, lw=6.0, alpha=0.25, label="± 2 standard errors"),
    ]
    joints = channel_names(rig.plant)
    with style.page():
        height = pages.head_height(style.FULL_WIDTH, handles) + ROW_HEIGHT * len(joints)
        page = pages.blank(style.FULL_WIDTH, height)
        axes = page.subplots(len(joints), 3, squeeze=False, width_ratios=(3, 2, 2))
        forces = measured_friction(rig, log)
        for i, (name, joint) in enumerate(zip(rig.columns.x, joints, strict=True)):
            unit = rig.plant.units[i]
            position_axes, residual_axes, friction_axes = axes[i]
            position_axes.plot(t, measured[name], color=style.INK, lw=LOG_WIDTH)
            position_axes.plot(t, predicted[name], color=colour, lw=1.2, ls=DASHES)
            position_axes.set_title(f"fit {fit[name]:.1f} %")
            position_axes.set_ylabel(lettering.folded(f"{joint} ({unit})"))
            speed = records.rate(measured[name], records.step_of(t))
            residual_axes.axhline(0.0, color=style.RULE, lw=0.8)
            residual = measured[name] - predicted[name]
            factor, short = shared_axes.prefixed(float(np.abs(residual).max()), unit)
            residual_axes.plot(speed, factor * residual, ".", ms=1.5, color=colour)
            fit_to(residual_axes, factor * residual, np.zeros(1))
            residual_axes.set_title(f"residual ({short})")
            _friction(friction_axes, rig, covariance, i, forces, colour)
        speed_label = f"speed ({rig.plant.units[-1]}/s)"
        for ax, label in zip(axes[-1], ("time (s)", speed_label, speed_label), strict=True):
            ax.set_xlabel(label)
        pages.set_head(page, style.FULL_WIDTH, rig.label, handles)
        pages.write_page(page, paths)
    return paths


def _friction(
    ax: Axes, rig: LogRig, covariance: Array, i: int, forces: tuple[Array, Array], colour: str
) -> None:
    """Draw the friction of a joint, with two standard errors, over that of the log."""
    speeds, points = forces
    ax.plot(speeds[:, i], points[:, i], ".", ms=1.5, color=style.INK, alpha=0.3)
    reach = float(np.abs(speeds[:, i]).max()) or 1.0
    side = np.linspace(1e-3 * reach, reach, SPEEDS)
    curves = []
    for v in (-side[::-1], side):
        curve = friction(rig, rig.values, i, v)
        error = 2.0 * curve_error(rig, covariance, i, v)
        ax.plot(v, curve, color=colour, lw=1.2)
        ax.fill_between(v, curve - error, curve + error, color=colour, alpha=0.25, lw=0.0)
        curves += [curve - error, curve + error]
    fit_to(ax, points[:, i], np.concatenate(curves))
    effort = rig.plant.efforts[i].replace(" ", "·")
    ax.set_title(f"friction ({effort})")


def fit_to(ax: Axes, points: Array, curves: Array) -> None:
    """Fit the vertical range to curves, (K,), and to most of the points, (M,)."""
    share = 0.5 * (1.0 - SHOWN_SHARE)
    seen = points[np.isfinite(points)]
    ends = np.quantile(seen, (share, 1.0 - share)) if len(seen) else curves
    low = min(float(curves.min()), *ends.tolist())
    high = max(float(curves.max()), *ends.tolist())
    margin = 0.1 * (high - low)
    if margin > 0.0:
        ax.set_ylim(low - margin, high + margin)


def friction(rig: LogRig, values: Numbers, i: int, v: Array) -> Array:
    """Return the friction of channel i at steady speeds v, (K,), by the model and the parts."""
    fields = rig.numbers_of(Values(**values))
    plant = fields["plant"]
    force = friction_of_model(plant, i, v)
    joint = channel_names(plant)[i]
    for part in fields.get("friction", ()):
        if joint in (names := part.joint_names(plant)):
            force = force + steady_force(part, v, names.index(joint))
    return force


def friction_of_model(plant: Plant, i: int, v: Array) -> Array:
    """Return the friction of channel i at speeds v, (K,), by the damping and the frictionloss of
    its joint in the model.
    """
    model = plant.load()
    dof = dof_ids(model)[i]
    return model.dof_damping[dof] * v + model.dof_frictionloss[dof] * np.sign(v)


def curve_error(rig: LogRig, covariance: Array, i: int, v: Array) -> Array:
    """Return the standard error of a joint's friction at steady speeds v, (K,), at first order."""
    values = rig.values
    plain = friction(rig, values, i, v)
    slopes = []
    for name in rig.free:
        step = 1e-3 * abs(values[name]) or 1e-6
        moved = friction(rig, values | {name: values[name] + step}, i, v)
        slopes.append((moved - plain) / step)
    J = np.array(slopes)
    return np.sqrt(np.maximum(np.einsum("pk,pq,qk->k", J, covariance, J), 0.0))


def measured_friction(rig: LogRig, record: Record) -> tuple[Array, Array]:
    """Return speeds, and the forces of a log less those of inertia, gravity and springs, (M, n)
    each, below 5 Hz: what is left is friction. NaN where a joint turns, or starts.
    """
    rubbing = {}
    for name in rig.plant.parameters:
        if name.endswith((".damping", ".frictionloss")):
            rubbing[name] = 0.0
    frictionless = dataclasses.replace(
        rig,
        plant=dataclasses.replace(
            rig.plant, parameters=dict(rig.plant.parameters) | rig.values_of_plant() | rubbing
        ),
        base=dataclasses.replace(rig.base, friction=None),
        places={},
        quantities={},
        free=(),
    )
    late = rig.values.get(DELAY, rig.base.input_delay)
    x, v, needed, commands = first_guess.motion_forces(frictionless, record, late)
    u = rig.of_motors("gain", 1.0) * commands + rig.of_motors("offset", 0.0)
    points = -needed
    for i in range(v.shape[1]):  # the file's own, of a joint whose friction is not a quantity
        points[:, i] += friction_of_model(frictionless.plant, i, v[:, i])
    for i, motor in enumerate(_motors(rig)):
        points[:, i] += motor.force_of(u[:, i], x[:, i] - rig.zeros[i], v[:, i])
    reach = round(REACH / COMPARED_PERIOD)
    for i in range(v.shape[1]):
        turns = np.flatnonzero(np.diff(np.sign(v[:, i])))
        for turn in (0, *turns.tolist()):
            points[max(turn + 1 - reach, 0) : turn + 1 + reach, i] = np.nan
    return v, points


def _motors(rig: LogRig) -> list[Actuator]:
    """Return the motor of each driven joint, with the rig's values."""
    drives = rig.numbers_of(Values(**rig.values)).get("actuator")
    return Scenario.recorded(plant=rig.plant, law="none", actuator=drives).drive_train.motors
