"""What simulation said of real machines, and what these did: the rows of twin_figures.json.

    python benchmarks/machines.py FOLDER [--seeds N] [--write]

FOLDER has the public records as npz files, one array a column, under the names below. Their sources
and licences are those that the rigs name; the records are not in the repository. Without a record
its old rows stay. EMPS, the QUBE-Servo 3 and the stepper need no file: what they are compared with
are numbers, a program and an excerpt.

A figure of a signal is its rms about its mean. Records are replayed from their measured state: in
closed loop where the machine's own controller is known, else under the recorded command; of the
double pendulum the torques of the motion are predicted.
"""

import argparse
import dataclasses
import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import programs
import stepper_figures as stepper
import twin_figures
from twin_figures import Order, TwinFigure

import smc_mujoco as smc
from smc_mujoco.common.version import versions
from smc_mujoco.identification.published_rig import PublishedRig
from smc_mujoco.identification.rig import Rig, percentages
from smc_mujoco.simulation.time_series import TimeSeries

STEP = Path(__file__).parents[1] / "tests" / "evidence" / "rigs" / "qube_servo_3_step.csv"
FIGURE = Path(__file__).parents[1] / "docs" / "rigs.svg"
EMPS_RECORD = {"rms error": 0.5814, "largest error": 0.8522}  # mm, of the public record
# of ten free falls while the swings are 8 to 25 degrees: figure -> its unit, and the machine's
FALLS = {"frequency": ("Hz", 2.432), "damping ratio": ("", 0.0261)}
QUBES = ("00", "06", "12", "18", "24", "30", "36", "42", "11")
SYS_IDS = ("01", "03", "05", "07", "13")
# Rig -> (record, law on the machine, file, published set that is told beside the twin)
FILES: Mapping[str, list[tuple[str, str, str, str]]] = {
    "qube_servo": [(name, "state feedback", f"qube-{name}", "driver") for name in QUBES],
    "realaigym_pendubot": [
        *(
            (f"sys-id {name}", "none", f"double_pendulum-C1-sysid-{name}", "model_1_0")
            for name in SYS_IDS
        ),
        ("pendubot 1", "iLQR and LQR", "double_pendulum-pendubot-ilqr_tvlqr_lqr-01", "model_1_0"),
        ("pendubot 2", "MC-PILCO", "double_pendulum-pendubot-mcpilco-01", "model_1_0"),
    ],
    "realaigym_acrobot": [
        ("acrobot 1", "iLQR and LQR", "double_pendulum-acrobot-ilqr_tvlqr_lqr-01", "model_1_0"),
        ("acrobot 2", "MC-PILCO", "double_pendulum-acrobot-mcpilco-01", "model_1_0"),
    ],
    "simple_pendulum_ak80": [
        (name, law, f"simple_pendulum-{name}", "")
        for name, law in (
            ("ddp", "DDP"),
            ("direct_collocation", "direct collocation"),
            ("energy_shaping", "energy shaping"),
            ("gravity_compensation", "gravity compensation"),
            ("pd-system_identification", "PD"),
        )
    ],
}
# Rig -> variant of the twin -> quantities that say so
VARIANTS = {"qube_servo": {"without the commutator": {"ripple": 0.0}}}


def size(values: np.ndarray) -> float:
    """Return the rms about the mean."""
    return float(np.std(values))


def of_record(
    rig: PublishedRig, name: str, law: str, file: Path, published: str
) -> Iterator[TwinFigure]:
    """Yield the rows of a record: one for each signal."""
    record = dict(np.load(file))
    members = list(rig.members().values())
    variants = {"": members} | {
        variant: [member.with_values(values, "left out") for member in members]
        for variant, values in VARIANTS.get(rig.name, {}).items()
    }
    control = rig.set(published) if published else None
    if control is None:
        beside = None
    else:
        beside = (control.predictions([record])[0], control.fits([record])[0])
    for variant, sets in variants.items():
        of_sets = [(member.predictions([record])[0], member.fits([record])[0]) for member in sets]
        for column, (figure, measured) in enumerate(of_sets[0][0][1].items()):
            values = []
            for (predicted, _, _), fits in of_sets:
                values.append(
                    math.inf if math.isinf(list(fits.values())[column]) else size(predicted[figure])
                )
            fit = float(list(of_sets[0][1].values())[column])
            public = math.nan
            if beside is not None and not variant:
                fell = math.isinf(list(beside[1].values())[column])
                if fell:
                    public = math.inf
                else:
                    public = size(beside[0][0][figure])
            yield TwinFigure(
                rig=rig.name,
                record=name,
                law=law,
                figure=f"{figure} rms",
                unit=rig.units[figure],
                machine=size(measured),
                twin=values[0],
                low=min(values),
                high=max(values),
                runs=len(sets),
                fit=fit,
                published=public,
                variant=variant,
            )


def of_emps() -> Iterator[TwinFigure]:
    """Yield the tracking errors of the program, also with other instants of the reference's
    samples.
    """
    rig = smc.rig("emps")
    program = programs.program()
    values = list(program.values)
    variants = {
        "": None,
        "with the reference a tick late": [values[0], *values[:-1]],
        "with the reference a tick early": [*values[1:], values[-1]],
    }
    for variant, torque in variants.items():
        predicted = programs.tracking(
            rig, None if torque is None else TimeSeries(program.times, torque)
        )
        for (figure, machine), twin in zip(EMPS_RECORD.items(), predicted, strict=True):
            yield TwinFigure(
                rig="emps",
                record="program of 24.8 s",
                law="cascade",
                figure=figure,
                unit="mm",
                machine=machine,
                twin=1e3 * twin,
                low=1e3 * twin,
                high=1e3 * twin,
                runs=1,
                variant=variant,
            )


def of_qube_servo_3() -> Iterator[TwinFigure]:
    """Yield the arm's step of 1 V, and frequency and damping ratio of falls."""
    rig = smc.rig("qube_servo_3")
    public = rig.set("quanser")
    step = np.genfromtxt(STEP, delimiter=",", names=True)
    step = step[step["t"] <= 0.8]

    def arm(parameters: Rig) -> np.ndarray:
        t, theta, _ = programs.moved(parameters, -1.0, 0.0, 0.8)
        return np.interp(step["t"], t, theta)

    sets = list(rig.members().values())
    arms = [arm(parameters) for parameters in sets]
    fits = [percentages({"theta": values}, {"theta": step["theta"]})["theta"] for values in arms]
    common = {"rig": rig.name, "law": "none", "runs": len(sets)}
    rms = [size(values) for values in arms]
    yield TwinFigure(
        record="step of 1 V",
        figure="theta rms",
        unit="rad",
        machine=size(step["theta"]),
        twin=rms[0],
        low=min(rms),
        high=max(rms),
        fit=fits[0],
        published=size(arm(public)),
        **common,
    )
    predicted = np.transpose([programs.falls(parameters) for parameters in sets])
    published = programs.falls(public)
    for (figure, (unit, machine)), twins, of_public in zip(
        FALLS.items(), predicted.tolist(), published, strict=True
    ):
        yield TwinFigure(
            record="ten free falls",
            figure=figure,
            unit=unit,
            machine=machine,
            twin=twins[0],
            low=min(twins),
            high=max(twins),
            published=of_public,
            **common,
        )


def of_stepper(seeds: int) -> Iterator[TwinFigure | Order]:
    """Yield the figures of all laws, and the order of laws in all sets, without parts of the twin
    too.
    """
    rig = smc.rig("stepper_furuta")
    sets = len(rig.members())
    by_condition = {name: stepper.predicted(rig, name, seeds) for name in stepper.CONDITIONS}
    for condition, by_set in by_condition.items():
        for law in stepper.ORDER:
            runs = [run for by_law in by_set.values() for run in by_law[law]]
            recorded = {}
            if law == stepper.FITTED_ON:
                recorded = stepper.RECORDED[condition]
            for figure, unit in stepper.SHOWN.items():
                values = stepper.standing(runs, figure)
                if not len(values):
                    continue
                middle, low, high = stepper.percentiles(values)
                yield TwinFigure(
                    rig=rig.name,
                    record=f"{condition}, {law.replace('_', ' ')}",
                    law=law.replace("_", " "),
                    figure=figure.replace("_", " "),
                    unit=unit,
                    machine=recorded.get(figure, math.nan),
                    twin=middle,
                    low=low,
                    high=high,
                    runs=len(values),
                )
    by_variant = {("", condition): by_set for condition, by_set in by_condition.items()}
    for part, changes in stepper.LEFT_OUT.items():
        few = stepper.predicted(rig, "hold", max(1, seeds // 4), changes)
        by_variant[f"without {part}", "hold"] = few
    for (variant, condition), by_set in by_variant.items():
        count, tau = stepper.ordered(by_set)
        yield Order(
            rig=rig.name,
            condition=condition,
            figure="alpha rms",
            laws=tuple(law.replace("_", " ") for law in stepper.ORDER),
            ordered=count,
            sets=sets,
            tau=tau,
            variant=variant,
        )


def described(row: TwinFigure) -> dict[str, object]:
    """Return a row as JSON data, without fields that have their default; None stands for NaN, and
    "falls" for inf.
    """
    data = {}
    for field in dataclasses.fields(row):
        value = getattr(row, field.name)
        if value is field.default or value == field.default:
            continue
        if isinstance(value, float) and math.isnan(value):
            value = None
        elif isinstance(value, float):
            value = "falls" if math.isinf(value) else float(f"{value:.4g}")
        data[field.name] = value
    return data


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "--seeds", type=int, default=4, help="of each law on each set of the stepper"
    )
    parser.add_argument(
        "--write", action="store_true", help="replace the rows, and draw docs/rigs.svg"
    )
    options = parser.parse_args()
    rows: list[TwinFigure | Order] = []
    for name, records in FILES.items():
        for record, law, file, published in records:
            if (path := options.folder / f"{file}.npz").is_file():
                rows += of_record(smc.rig(name), record, law, path, published)
            else:
                print(f"{path} is not there: its old rows stay")
                rows += [
                    twin_row for twin_row in twin_figures.rows(name) if twin_row.record == record
                ]
    rows += [*of_emps(), *of_qube_servo_3()]
    rows += of_stepper(options.seeds)
    data = {
        "command": f"python benchmarks/machines.py FOLDER --seeds {options.seeds} --write",
        "versions": versions(),
        "figures": [described(row) for row in rows if isinstance(row, TwinFigure)],
        "orders": [dataclasses.asdict(row) for row in rows if isinstance(row, Order)],
    }
    for row in rows:
        if isinstance(row, TwinFigure):
            numbers = (
                f"{row.machine:9.4g} {row.twin:9.4g} ({row.low:.4g} to {row.high:.4g}) "
                f"{row.published:9.4g}"
            )
            print(
                f"{row.rig:21} {row.record:26} {row.law:18} {row.figure:16} {numbers} {row.use} "
                f"{row.variant}"
            )
        else:
            print(
                f"{row.rig:21} {row.condition}: {row.ordered} of {row.sets}, tau {row.tau:.2f} "
                f"{row.variant}"
            )
    if options.write:
        twin_figures.FILE.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
        _, picture = twin_figures.twins_figure(twin_figures.rows(), FIGURE)
        picture.unlink()  # as PNG


if __name__ == "__main__":
    main()
