"""A trace: what one run did at its control samples, with the scenario that made it."""

import csv
import dataclasses
import hashlib
import math
import os
import warnings
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib import format as npy

from smc_mujoco.common.aliases import AnyPath, Array, Fields, Names
from smc_mujoco.common.errors import (
    ScenarioError,
    ScenarioWarning,
    find,
    one_line,
    printable,
    users_stacklevel,
    warn_once,
    words,
)
from smc_mujoco.common.extras import package
from smc_mujoco.common.files import CHANGED, as_path, from_json, reading, replacing, to_json
from smc_mujoco.common.tabular import of_fields
from smc_mujoco.mechanisms.hardware.tendons import of_plant
from smc_mujoco.mechanisms.layout import channel_names, column_ends, loaded
from smc_mujoco.mechanisms.plant import EFFORT
from smc_mujoco.simulation import damping, scenario_json
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.state import LOGGED

if TYPE_CHECKING:
    import pandas  # pyright: ignore[reportMissingImports]
    import xarray  # pyright: ignore[reportMissingImports]

ARRAYS = ("t", *LOGGED)
OPTIONAL = ("held", "damping", "compensation", "tension")
PLANT_DIVERGED = "the plant diverged"  # how the failure of such a run begins
MAX_FAILURE = 500  # characters; chosen
MAX_TEXT = 2**26  # characters of a scenario in a file, 64 million; chosen
FILE = (
    "trace of smc_mujoco",
    "give the path of a .npz file that a run wrote",
)  # for errors: what it is, and the cure


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Trace:
    """One run at control samples t_k = k * control_period, k = 0 .. K.

    The arrays are read-only; NaN from a failure on.

    Attributes:
      t: times, (K + 1,), s.
      x, v: true positions and velocities, (K + 1, n), in the channels' `plant.units`, and per
        second.
      u: commanded control after saturation, constant from t_k to t_(k+1), (K + 1, n), N or N m, or
        V if the motor's command is a voltage.
      applied: what the actuator gets at t_k, i.e. u after the input delay, (K + 1, n).
      s: sliding variable as the law returns it, (K + 1, n).
      d: disturbances on the joint's body, as a generalised force on the joint, (K + 1, n), N or N
        m.
      r: reference, (K + 1, n); free joints have none, and get the plant's goal.
      force: of the actuator on the joint, or on the rotor of a Backlash or an ElasticJoint,
        (K + 1, n), N or N m.
      reaction: what friction, contacts and stops exert on the joint, (K + 1, n), N or N m, with
        the damping of Viscous and of your own file's joint. So that no blow is missed, force and
        reaction are means over the physics steps of the control period that ends at t_k; at t = 0
        they are 0.
      scenario: the Scenario of the run.
      diverged_at: time in s at which the run failed, or None.
      failure: what happened then, in a sentence, or None.
      held: time for which dry friction held the joint in the control period that ends at t_k, (K +
        1, n), s, by the friction's own state, if the scenario has `exact_friction`; None where dry
        friction is MuJoCo's, or none.
      damping: the part of `reaction` that damping exerts, (K + 1, n), N or N m; None without any.
      compensation: what a Feedforward asked for beside the law, (K + 1, n), in the unit of u; None
        without one.
      tension: of the tendons that drive joints, (K + 1, tendons), N, in the order of the
        file's actuators; None where motors do.

    Of a free body x is its position, in the world's axes, and the rotation vector of its attitude;
    v its velocity in the world's axes, and its angular velocity in its own. u, d, force and
    reaction are forces and torques in the same axes; u is what the law asks for, and `applied` what
    its actuators get, the first in the first channel, and so on.
    """

    t: Array
    x: Array
    v: Array
    u: Array
    applied: Array
    s: Array
    d: Array
    r: Array
    force: Array
    reaction: Array
    scenario: Scenario
    diverged_at: float | None = None
    failure: str | None = None
    held: Array | None = None
    damping: Array | None = None
    compensation: Array | None = None
    tension: Array | None = None

    def __post_init__(self):
        for array in self.arrays().values():
            np.ndarray.setflags(array, write=False)  # a TypeError for what is no array

    @property
    def e(self) -> Array:
        """Errors, (K + 1, n), see `Plant.errors`."""
        return self.scenario.plant.errors(self.x, self.r)

    def arrays(self) -> dict[str, Array]:
        """Return the arrays by name; those of OPTIONAL only if they are not None."""
        arrays = {}
        for name in (*ARRAYS, *OPTIONAL):
            array = getattr(self, name)
            if array is not None:
                arrays[name] = array
        return arrays

    @property
    def holding(self) -> Array:
        """The reaction without damping, (K + 1, n), N or N m: what can hold a joint at rest."""
        return self.reaction if self.damping is None else self.reaction - self.damping

    @property
    def unmet(self) -> str:
        """What a blow of the run was to meet and did not, in a sentence; "" if nothing."""
        from smc_mujoco.simulation.blow import unmet

        return unmet(self)

    @property
    def unreached(self) -> str:
        """What of the commands the tendons could not give, in a sentence; "" if nothing."""
        from smc_mujoco.simulation.tendon_forces import unreached

        return unreached(self)

    @property
    def unresolved(self) -> str:
        """What the physics step does not resolve in this run of your own model, in a sentence; ""
        if nothing is known. `smc.run` warns of it.
        """
        from smc_mujoco.simulation.resolution import unresolved

        return unresolved(self)

    def __setstate__(self, fields: dict) -> None:  # so that the arrays of a copy are read-only, too
        vars(self).update(fields)
        self.__post_init__()

    def __repr__(self) -> str:
        if self.diverged_at is None:
            end = ""
        else:
            end = f", {self.failure}"
        law = self.scenario.law
        return (
            f"Trace({self.scenario.plant.name}, {law}, gains: {law.source}, {len(self.t)} "
            f"samples{end})"
        )

    def _repr_html_(self) -> str:
        """Return what was run, how it failed if it did, and the range of x and u in each unit."""
        s = self.scenario
        rows = {
            "plant": s.plant.name,
            "law": s.law,
            "gains": s.law.source,
        }
        if s.exact_friction:
            rows["dry friction"] = "its mean and first moment in each step"
        rows["samples"] = f"{len(self.t)}, every {s.control_period:g} s"
        if self.failure:
            rows["failed"] = self.failure
        if self.unresolved:
            rows["not resolved"] = self.unresolved
        if self.unmet:
            rows["not met"] = self.unmet
        if self.unreached:
            rows["not reached"] = self.unreached
        efforts = s.efforts[: s.plant.driven]
        for name, units in (("x", s.plant.units), ("u", efforts)):
            for unit in dict.fromkeys(units):
                columns = [i for i, of_channel in enumerate(units) if of_channel == unit]
                values = getattr(self, name)[:, columns]
                finite = values[np.isfinite(values)]
                samples = finite.tolist() or [math.nan]
                rows[f"{name} ({unit})"] = f"{min(samples):.3g} to {max(samples):.3g}"
        return of_fields("Trace", rows)._repr_html_()

    def save(self, path: AnyPath) -> Path:
        """Write a .npz file that `smc.load` reads back.

        Make missing folders, and replace an old file atomically.
        """
        path = as_path(path)
        if not path.name or "\0" in path.name:
            raise ScenarioError(f"cannot save to {str(path)!r}: give the file a name")
        if path.suffix not in ("", ".npz"):
            raise ScenarioError(f"cannot save to {path.name!r}: end the name in .npz")
        path = path.with_suffix(".npz")
        about = to_json(
            scenario_json.describe(self.scenario)
            | {"diverged_at": self.diverged_at, "failure": self.failure}
        )
        if len(about) > MAX_TEXT:
            raise ScenarioError(
                f"cannot save {path}: its scenario is a text of {len(about):,} characters and more "
                f"than {MAX_TEXT:,} are not read back: give it shorter time series"
            )
        arrays: Fields = {"about": np.array(about)} | self.arrays()
        arrays["seal"] = np.array(_seal(arrays))
        with replacing(path) as file:
            np.savez_compressed(file, **arrays)
        return path

    @property
    def plant_diverged(self) -> bool:
        """Whether the run failed because its plant diverged, not because its law or a signal
        failed.
        """
        return self.diverged_at is not None and (
            self.failure is None or self.failure.startswith(PLANT_DIVERGED)
        )

    @property
    def broken(self) -> str:
        """How the law or a signal failed, in a sentence; "" if neither did."""
        if self.failure is None or self.plant_diverged:
            return ""
        return self.failure

    def columns(self) -> dict[str, Array]:
        """Return the arrays by channel: t, x, v, ... for one channel, t, x0, x1, ..., v0, ... for
        several.

        Several of your own model have the names of its joints: x_shoulder, x_elbow, ...
        """
        ends = column_ends(self.scenario.plant)
        columns = {"t": self.t}
        for name in ARRAYS[1:]:
            for end, column in zip(ends, getattr(self, name).T, strict=True):
                columns[f"{name}{end}"] = column
        return columns

    def units(self) -> dict[str, str]:
        """Return the unit of each of the `columns`: "s", "rad", "N m", ...; "" for s, whose unit
        depends on the law.
        """
        units = []
        for name in ARRAYS[1:]:
            for unit in self._units(name):
                units.append(unit)
        pairs = zip(self.columns(), ["s", *units], strict=True)
        return dict(pairs)

    def _units(self, name: str) -> list[str]:
        """Return the unit of an array for each channel, (n,)."""
        pairs = zip(self.scenario.plant.units, self.scenario.efforts, strict=True)
        units_by_channel = []
        for x, u in pairs:
            units = {
                "x": x,
                "r": x,
                "v": f"{x}/s",
                "u": u,
                "applied": u,
                "s": "",
            }
            units_by_channel.append(units.get(name, EFFORT[x]))
        return units_by_channel

    def _unit(self, name: str) -> str:
        """Return the unit of an array, or those of its channels where they differ: "m, rad"."""
        units = ["s"] if name == "t" else self._units(name)
        if len(set(units)) == 1:
            return units[0]
        return ", ".join(units)

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """Return the `columns` as a stream of Arrow's C interface: what polars.from_dataframe and
        duckdb take.
        """
        with package("pyarrow", "Trace.__arrow_c_stream__"):
            import pyarrow

        return pyarrow.table(self.columns()).__arrow_c_stream__(requested_schema)

    def __iter__(self) -> Iterator[dict[str, float]]:
        """Yield each sample as column -> value, as pandas.DataFrame(trace) reads it."""
        columns = self.columns()
        for row in zip(*columns.values(), strict=True):
            yield dict(zip(columns, row, strict=True))

    def to_pandas(self) -> "pandas.DataFrame":
        """Return the `columns` as a pandas DataFrame, indexed by t.

        Its `attrs` have the "units" and the "scenario".

        Raises:
          MissingPackageError: pandas is not installed.
        """
        with package("pandas", "Trace.to_pandas"):
            import pandas  # pyright: ignore[reportMissingImports]

        columns = self.columns()
        index = pandas.Index(columns.pop("t"), name="t")
        frame = pandas.DataFrame(columns, index=index)
        frame.attrs = {
            "units": self.units(),
            "scenario": to_json(scenario_json.describe(self.scenario)),
        }
        return frame

    def to_xarray(self) -> "xarray.Dataset":
        """Return the arrays as an xarray Dataset: a variable for each, with dimensions t and
        channel.

        Each variable has its unit in `attrs["units"]`, or those of its channels, "m, rad". The
        coordinate "joint" has the names of the joints. The Dataset's `attrs` have the "scenario",
        and of a run that failed the "failure".

        Raises:
          MissingPackageError: xarray is not installed.
        """
        with package("xarray", "Trace.to_xarray"):
            import xarray  # pyright: ignore[reportMissingImports]

        about = {"scenario": to_json(scenario_json.describe(self.scenario))}
        variables = {}
        for n in ARRAYS[1:]:
            attributes = {"units": self._unit(n)}
            variables[n] = (("t", "channel"), getattr(self, n), attributes)
        joints = "channel", list(channel_names(self.scenario.plant))
        coords = {
            "t": ("t", self.t, {"units": "s"}),
            "channel": np.arange(self.x.shape[1]),
            "joint": joints,
        }
        return xarray.Dataset(
            variables, coords, about | ({"failure": self.failure} if self.failure else {})
        )

    def export(self, path: AnyPath) -> Path:
        """Write the trace to a .csv, .parquet or .mat (MATLAB 5) file, without losing a bit.

        CSV: a header line with units, "t [s]", "x [rad]", ..., then a line per sample, with the
        fewest digits that identify each number (0.1, not 0.10000000000000001), and nan after a
        failure. x and v are the true ones, not what a sensor read: `smc.measured(trace)` has what
        the encoders read. Parquet: the `columns`; the
        metadata of each column has its "unit", and that of the schema the "scenario", as JSON. MAT:
        the arrays by name, (K + 1, n), a struct `units` with the unit of each ("m, rad" if channels
        differ), and `scenario`.

        Raises:
          ScenarioError: the name has another ending.
        """
        path = as_path(path)
        if path.suffix not in _WRITERS:
            raise ScenarioError(
                f"cannot export to {path.name!r}: end the name in .csv, .mat or .parquet"
            )
        with replacing(path) as file:
            _WRITERS[path.suffix](self, file)
        return path


def _write_csv(trace: Trace, file: Path) -> None:
    header = []
    for name, unit in trace.units().items():
        header.append(f"{name} [{unit}]" if unit else name)
    with file.open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream, lineterminator="\n").writerow(header)
        for row in np.column_stack(list(trace.columns().values())):
            stream.write(f"{','.join(map(repr, row.tolist()))}\n")


def _write_mat(trace: Trace, file: Path) -> None:
    from scipy.io import savemat

    about = to_json(scenario_json.describe(trace.scenario))
    arrays = {name: getattr(trace, name) for name in ARRAYS}
    units = {n: trace._unit(n) for n in ARRAYS}
    savemat(
        file,
        arrays | {"units": units, "scenario": about},
        oned_as="column",
    )


def _write_parquet(trace: Trace, file: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    about = to_json(scenario_json.describe(trace.scenario))
    fields = []
    for name, unit in trace.units().items():
        field = pa.field(name, pa.float64(), metadata={"unit": unit})
        fields.append(field)
    with file.open("wb") as stream:  # opened here, so that errors are those of other files
        parquet.write_table(
            pa.table(trace.columns(), pa.schema(fields, metadata={"scenario": about})), stream
        )


_WRITERS = {
    ".csv": _write_csv,
    ".mat": _write_mat,
    ".parquet": _write_parquet,
}
EXPORT_FORMATS = tuple(ending.removeprefix(".") for ending in _WRITERS)  # of Trace.export


def formats(text: str) -> Names:
    """Return the formats of Trace.export in a text such as "csv,mat"."""
    names = {}
    for part in text.split(","):
        names[part.strip().lower().removeprefix(".")] = None
    for name in names:
        find("format to export", name, dict.fromkeys(EXPORT_FORMATS))
    return tuple(names)


def from_log(scenario: Scenario, log: Array, failed_step: int, failure: str | None) -> Trace:
    """Return the Trace of a log, (K + 1, n) LOG, of a run that failed at a physics step, or that
    did not fail.

    A number that is not finite counts as a failure, and the trace is NaN from there on.
    """
    t = np.arange(scenario.samples + 1) * scenario.control_period
    diverged_at = None
    if failure is None:
        end = len(t)
    else:
        end = math.ceil(failed_step / scenario.steps)
    names: list[str] = list(LOGGED)
    if scenario.exact_friction:
        names.append("held")
    if scenario.compensated:
        names.append("compensation")
    arrays = {name: np.ascontiguousarray(log[name]) for name in names}
    if scenario.plant.goal and not scenario.plant.measured:
        arrays["r"][:, scenario.plant.driven :] = scenario.plant.goal
    finite_by_array = []
    for values in arrays.values():
        fits = np.isfinite(values[:end])
        finite_by_array.append(fits.all(axis=1))
    finite = np.array(finite_by_array)
    if not finite.all():
        k = int(np.argmin(finite.all(axis=0)))
        name = names[int(np.argmin(finite[:, k]))]
        end = k
        failed_step = k * scenario.steps
        failure = f"{name} became NaN or inf"
    if failure is not None:
        for values in arrays.values():
            values[end:] = np.nan
        diverged_at = failed_step * scenario.resolved.physics_step
        failure = f"{one_line(failure, MAX_FAILURE)}, at t = {diverged_at:.6g} s"
    damped = damping.forces(scenario, arrays["x"])
    if damped.any():
        arrays["damping"] = damped
        arrays["reaction"] += damped
    if tendons := of_plant(scenario.plant):
        model = loaded(scenario.plant)
        arrays["tension"] = tendons.shared(model, arrays["x"], arrays["applied"])[0]
    return Trace(
        **arrays,
        t=t,
        scenario=scenario,
        diverged_at=diverged_at,
        failure=failure,
    )


def load(path: AnyPath) -> Trace:
    """Return the trace in a file that `Trace.save` wrote.

        smc.run(smc.Scenario(plant="duffing", law="pid", duration=1.0)).save("run.npz")
        trace = smc.load("run.npz")

    Returns:
      A Trace.

    Raises:
      ScenarioError: there is no such file, or it is not a trace.
    """
    if (
        isinstance(path, str | os.PathLike)
        and not os.path.exists(path)
        and os.path.exists(f"{os.fspath(path)}.npz")
    ):
        path = f"{os.fspath(path)}.npz"
    with reading(path, *FILE) as file, zipfile.ZipFile(file) as archive:
        about = from_json(str(_checked_array(archive, "about")))
        end = {key: about.pop(key) for key in ("diverged_at", "failure")}
    try:
        scenario = scenario_json.restore(about)
    except ScenarioError as error:  # with its cure
        raise ScenarioError(f"the scenario of {path} cannot be restored, {error}") from None
    except Exception as error:
        raise ScenarioError(
            f"{path} holds no scenario ({words(error)}): give a file that a run wrote"
        ) from None
    with reading(path, *FILE) as file, zipfile.ZipFile(file) as archive:
        members = archive.namelist()
        names: list[str] = list(ARRAYS)
        for name in OPTIONAL:
            if f"{name}.npy" in members:
                names.append(name)
        arrays = {name: _checked_array(archive, name, scenario) for name in names}
        sealed = "seal.npy" in members  # those of older versions have none
        if sealed:
            content = {"about": _checked_array(archive, "about")} | arrays
            if str(_checked_array(archive, "seal")) != _seal(content):
                raise ScenarioError(CHANGED)
    if not sealed:
        warn_once(
            f"{printable(str(path))} has no seal, so nothing shows whether its numbers are those "
            "of the run: run its scenario again, smc.run(trace.scenario)"
        )
    return Trace(**arrays, scenario=scenario, **end)


def _seal(arrays: Mapping[str, Array]) -> str:
    """Return a hash of all arrays of a file, 64 hex digits."""
    digest = hashlib.sha256()
    for name, array in sorted(arrays.items()):
        content = array.tobytes() if array.dtype.kind == "f" else str(array).encode()
        digest.update(name.encode() + content)
    return digest.hexdigest()


def _checked_array(archive: zipfile.ZipFile, name: str, scenario: Scenario | None = None) -> Array:
    """Return an array of a file; a text if `scenario` is None.

    Check type and shape before the array is read.
    """
    with archive.open(f"{name}.npy") as stream:
        headers = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
        shape, _, dtype = headers[npy.read_magic(stream)](stream)
    if scenario is None:
        expected = shape == () and dtype.kind == "U" and dtype.itemsize <= 4 * MAX_TEXT
    else:
        tendons = of_plant(scenario.plant)
        columns = len(tendons.cables) if name == "tension" and tendons else scenario.plant.n
        rows = scenario.samples + 1
        expected = dtype == np.dtype(float) and shape == (
            (rows,) if name == "t" else (rows, columns)
        )
    if not expected:
        raise ScenarioError(
            f"its {name} is {dtype} of shape {shape}, which does not fit its scenario"
        )
    with archive.open(f"{name}.npy") as stream:
        array = npy.read_array(stream, allow_pickle=False)
        if stream.read(1):  # the checksum is compared at the end
            raise ScenarioError(f"its {name} is longer than it says")
    return array


def warn_of_broken(laws: Mapping[str, str]) -> None:
    """Warn of laws that failed by themselves, name -> `Trace.broken`: it is no property of theirs,
    but a mistake.
    """
    for name, failure in laws.items():
        warnings.warn(
            f"a run of {name} failed by itself: {failure}", ScenarioWarning, users_stacklevel()
        )
