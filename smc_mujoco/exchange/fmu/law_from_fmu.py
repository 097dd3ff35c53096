"""Controllers in FMUs as laws:

`law_from_fmu` reads FMI 2.0 and 3.0 for Co-Simulation, through FMPy.

An FMU from Simulink, Modelica or `law_to_fmu` keeps its own state. So each channel of each run has
its own instance, which is made at the first sample and freed with the run. The instance is called
from Python, in this process, which it may crash.
"""

import dataclasses
import errno
import functools
import hashlib
import itertools
import keyword
import math
import re
import weakref
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from smc_mujoco.common import errors
from smc_mujoco.common.aliases import AnyPath, Array, Data, Names, Numbers, Pair
from smc_mujoco.common.constraints import Positive, constrained
from smc_mujoco.common.errors import ScenarioError, number, one_line, unknown
from smc_mujoco.common.extras import extra
from smc_mujoco.common.files import no_room, reading
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.jit import Uncompiled
from smc_mujoco.control.component import Template
from smc_mujoco.control.law import Measurement, law_function
from smc_mujoco.control.units import Gain
from smc_mujoco.exchange.c import build
from smc_mujoco.exchange.fmu.contents import MAX_DOUBLE, OUTPUTS
from smc_mujoco.exchange.fmu.slave import CONSTANT_TYPES, REAL_TYPES, Slave

INPUT_FIELDS = tuple(n for n in Measurement._fields if n not in ("has_surface", "s", "v_eq"))
PERIOD_TOLERANCE = 1e-6  # relative difference below which two periods are equal
CURE = "give an FMU for Co-Simulation of FMI 2.0 or 3.0"


class Instances:
    """The instances that run, by the number that the law's memory holds."""

    def __init__(self) -> None:
        self.by_number: dict[int, Running] = {}

    def __reduce__(self) -> str:
        """Pickle by name: a law's fingerprint does not depend on what runs meanwhile."""
        return "_running"


_running = Instances()
_numbers = itertools.count(1)


class Running(NamedTuple):
    """The instance of an FMU for one channel of a run."""

    law: "FmuLaw"
    slave: Slave
    start: float  # s: time of the first sample
    last: list[float]  # u and s of the last step
    steps: list[int]  # number of its steps, and the sample from which the next ones are due


@dataclasses.dataclass(frozen=True)
class FmuLaw(Uncompiled):
    """The function of a law in an FMU.

    Two are equal if the content of the file and the settings are.
    """

    path: str = dataclasses.field(compare=False)  # of the .fmu file
    digest: str  # of its bytes
    name: str  # of the law
    inputs: tuple[tuple[str, str], ...]  # our name and the FMU's
    outputs: Names  # the FMU's name of u, and of s if it has s
    constants: tuple[
        tuple[str, float], ...
    ]  # the FMU's name and the value of inputs that do not change
    parameters: Names  # the FMU's names of its gains
    period: float | None  # of its steps, s; None for the control period

    why = "is an FMU, called from Python"

    @property
    def __name__(self) -> str:
        """The law's name."""
        return self.name

    def __call__(self, y: Measurement, gains: Sequence[float], memory: Array) -> Pair:
        """Return u and s. The memory holds the number of the instance, 0 before the first sample.

        The FMU's own time counts its steps: it has none for a sample that is missed, and a late one
        is none to it.
        """
        if memory[0] == 0.0:
            memory[0] = self._begin(y, gains, memory)
        running = _running.by_number[int(memory[0])]
        samples, length = steps(self.period, y.dt)
        done, due = running.steps
        passed = y.t - running.start
        k = math.floor(passed / y.dt + PERIOD_TOLERANCE)
        if k >= due:
            values = [getattr(y, ours) for ours, _ in self.inputs]
            for _ in range(round(samples * y.dt / length)):
                running.last[: len(self.outputs)] = running.slave.step(
                    values, running.start + done * length, length
                )
                done += 1
            running.steps[:] = done, samples * (k // samples + 1)
        return running.last[0], running.last[1]

    def fixed(self, gains: Iterable[float]) -> dict[str, float]:
        """Return the FMU's name -> the value of each constant and parameter."""
        values = (max(-MAX_DOUBLE, min(float(gain), MAX_DOUBLE)) for gain in gains)
        parameters = zip(self.parameters, values, strict=False)
        return dict(self.constants) | dict(parameters)

    def _begin(self, y: Measurement, gains: Sequence[float], memory: Array) -> int:
        """Start an instance, which ends when the memory of the run is freed. Return its number."""
        place = next(_numbers)
        names = [theirs for _, theirs in self.inputs]
        slave = Slave(
            str(extracted(self.path, self.digest)), names, self.outputs, self.fixed(gains), y.t
        )
        _running.by_number[place] = Running(self, slave, y.t, [0.0, 0.0], [0, 0])
        owner: Any = memory if memory.base is None else memory.base
        weakref.finalize(owner, _end, place)
        return place


def steps(period: float | None, dt: float) -> tuple[int, float]:
    """Return after how many control periods of dt, s, the FMU steps, and how long a step is, s."""
    if period is None:
        return 1, dt
    slower = period / dt
    faster = dt / period
    if abs(slower - round(slower)) < PERIOD_TOLERANCE * slower and round(slower) >= 1:
        return round(slower), round(slower) * dt
    if abs(faster - round(faster)) < PERIOD_TOLERANCE * faster:
        return 1, dt / round(faster)
    raise ScenarioError(
        f"the FMU steps every {period:g} s and the law runs every {dt:g} s: give "
        f"control_period={period:g}"
    )


def _end(place: int) -> None:
    """End an instance, if it has not ended yet. Exceptions of its library are ignored."""
    try:
        _running.by_number.pop(place).slave.close()
    except Exception:
        return


@functools.lru_cache(maxsize=64)
def extracted(path: str, digest: str) -> Path:
    """Return the folder with an FMU's extracted files, from its path and the hash that it had."""
    try:
        now = hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except OSError:
        now = ""
    if now != digest:
        raise ScenarioError(
            f"FMU {Path(path).name!r} is gone or has changed: call law_from_fmu again"
        )
    folder = build.fresh("-fmu")
    with zipfile.ZipFile(path) as archive, no_room(errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        archive.extractall(folder)
    return folder


@constrained
def law_from_fmu(
    path: AnyPath,
    *,
    variables: Mapping[str, str] | None = None,
    constants: Numbers | None = None,
    period: Positive | None = None,
    name: str | None = None,
) -> Template:
    """Load a controller in an FMU as a law, such as one that Simulink or a Modelica tool exported.

    Args:
      path: of an .fmu file: FMI 2.0 or 3.0, Co-Simulation, with a binary for this machine.
      variables: our name -> the FMU's name, as {"x": "theta", "u": "torque"}. Ours are those of a
        law's measurement (x, v, e, de, r, dr, ddr, f, g, ...), u and s. Default: those that have
        our names, such as plant.x; a single output is u.
      constants: name -> value of the FMU's inputs that have none of these meanings.
      period: s; the FMU steps this often, and u is held in between. Default: its own period if it
        has a fixed one, else the control period.
      name: of the law. Default: the file's name.

    Returns:
      A Template. Its gains are the FMU's real parameters, with _ in place of dots and brackets:
      law_from_fmu("c.fmu")(law_lam=5.0). Gains that are not given keep the FMU's own values.

    Raises:
      MissingPackageError: FMPy is not installed: pip install 'smc-mujoco[fmu]'.
      ScenarioError: the file is not an FMU, or is of another version, without Co-Simulation or for
        other machines; a variable is unknown; or an input has no meaning.

    u is what the FMU returns after a step from the sample's time, on the measurement of that
    sample. The FMU is part of your process: if it crashes, Python ends. Load only what you trust.
    """
    with extra("fmu", "smc.exchange.law_from_fmu"):
        import fmpy  # noqa: F401
    with reading(path, "functional mock-up unit", "give the path of an .fmu file") as file:
        file.open("rb").close()
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    about = _description(file, digest)
    variables_by_name = {variable.name: variable for variable in about.modelVariables}
    held = frozen({} if constants is None else constants)
    chosen = frozen({} if variables is None else variables)
    inputs, outputs = _meanings(file.name, variables_by_name, chosen, held)
    gains = _gains(variables_by_name.values())
    law = FmuLaw(
        path=str(file.resolve()),
        digest=digest,
        name=errors.name("name", re.sub(r"\W", "_", file.stem) if name is None else name),
        inputs=tuple(inputs.items()),
        outputs=tuple(outputs.values()),
        constants=tuple((key, number(f"constants[{key!r}]", value)) for key, value in held.items()),
        parameters=tuple(theirs for theirs, _ in gains.values()),
        period=_period(about) if period is None else period,
    )
    return law_function(gains={ours: gain for ours, (_, gain) in gains.items()}, memory=1)(law)


def _description(file: Path, digest: str) -> Any:
    """Return FMPy's description of an FMU."""
    import fmpy

    try:
        folder = extracted(str(file.resolve()), digest)
        about = fmpy.read_model_description(str(folder), validate=False)
    except ScenarioError:
        raise
    except Exception as error:  # a damaged archive or XML raises any exception there is
        why = f"{type(error).__name__}: {one_line(str(error), 80)}"
        raise ScenarioError(f"{file.name} is not an FMU ({why}): {CURE}") from error
    version = str(about.fmiVersion)
    if version[:2] not in ("2.", "3.") or about.coSimulation is None:
        raise ScenarioError(f"{file.name} is of FMI {version}, or not for Co-Simulation: {CURE}")
    here = fmpy.platform if version.startswith("2") else fmpy.platform_tuple
    binaries = (folder / "binaries" / here).glob("*")
    if not any(binary.stem == about.coSimulation.modelIdentifier for binary in binaries):
        machines = sorted(path.name for path in (folder / "binaries").glob("*"))
        raise ScenarioError(
            f"{file.name} has a binary for {', '.join(machines) or 'no machine'}, and this one is "
            f"{here}: export it for this one, or compile its sources with FMPy, fmpy compile"
        )
    return about


def _meanings(
    file: str, known: Data, chosen: Mapping[str, str], constants: Numbers
) -> tuple[dict[str, str], dict[str, str]]:
    """Return our name -> the FMU's, for its inputs and for its outputs, of the `known` variables by
    name.
    """
    names: dict[str, list[str]] = {"input": [], "output": []}
    for name, variable in known.items():
        names.setdefault(variable.causality, []).append(name)
    ins = names["input"]
    outs = names["output"]
    for ours, theirs in chosen.items():
        if ours not in (*INPUT_FIELDS, *OUTPUTS):
            raise unknown("meaning of a variable", ours, (*INPUT_FIELDS, *OUTPUTS))
        side = "output" if ours in OUTPUTS else "input"
        candidates = dict.fromkeys(names[side], "")
        errors.find(f"{side} of {file}", theirs, candidates)
    for theirs in constants:
        errors.find(f"input of {file}", theirs, dict.fromkeys(ins, ""))
    taken = {*chosen.values(), *constants}
    inputs = _by_name(ins, INPUT_FIELDS, taken, chosen)
    strange = []
    for theirs in ins:
        if theirs not in {*inputs.values(), *constants}:
            strange.append(theirs)
    if strange:
        first = strange[0]
        raise ScenarioError(
            f"{file} has inputs that mean nothing that a law measures, {', '.join(strange[:4])}: "
            f"say which it is, variables={{'x': {first!r}}}, or hold each, "
            f"constants={{{first!r}: 0.0}}"
        )
    outputs = _by_name(outs, OUTPUTS, taken, chosen)
    if "u" not in outputs and len(outs) != 1:
        raise ScenarioError(
            f"{file} has no output that is named as a command ({', '.join(outs) or 'none'}): "
            "say which it is, as in variables={'u': 'torque'}"
        )
    outputs.setdefault("u", outs[0])
    types = dict.fromkeys(constants, CONSTANT_TYPES)
    types |= dict.fromkeys((*inputs.values(), *outputs.values()), REAL_TYPES)
    for theirs, fitting in types.items():
        if known[theirs].type not in fitting or known[theirs].dimensions:
            raise ScenarioError(
                f"{theirs!r} of {file} is not one number: export it without this variable"
            )
    named = {}
    for ours in OUTPUTS:
        if ours in outputs:
            named[ours] = outputs[ours]
    return inputs, named


def _by_name(
    theirs: Iterable[str], ours: Iterable[str], taken: set[str], chosen: Mapping[str, str]
) -> dict[str, str]:
    """Return our name -> the FMU's: those chosen, and then those whose name, after the last dot, is
    ours; case is ignored.
    """
    words = {}
    for name in theirs:
        if name not in taken:
            words[name.rsplit(".", 1)[-1].casefold()] = name
    matches = {}
    for name in ours:
        if name in chosen:
            matches[name] = chosen[name]
        elif name in words:
            matches[name] = words[name]
    return matches


def _gains(variables: Iterable[Any]) -> dict[str, tuple[str, Gain]]:
    """Return name of a gain -> the FMU's name and the Gain, for its real parameters."""
    gains: dict[str, tuple[str, Gain]] = {}
    for variable in variables:
        real = variable.type in REAL_TYPES and not variable.dimensions
        if variable.causality != "parameter" or not real:
            continue
        try:
            start = float(variable.start)
        except (TypeError, ValueError):
            continue
        ours = re.sub(r"\W+", "_", variable.name).strip("_")
        if keyword.iskeyword(ours):
            ours += "_"
        if not ours.isidentifier() or ours.startswith("_") or ours in gains or math.isnan(start):
            continue
        if abs(start) >= MAX_DOUBLE:
            start = math.copysign(math.inf, start)
        lowest = variable.min is not None and float(variable.min) == 0.0
        gains[ours] = variable.name, Gain(start, nonnegative=lowest)
    return gains


def _period(about: Any) -> float | None:
    """Return the step that an FMU prescribes, s; None if it takes any."""
    inside = about.coSimulation
    if inside.canHandleVariableCommunicationStepSize:
        return None
    of_fmu = getattr(inside, "fixedInternalStepSize", None)
    of_experiment = getattr(about.defaultExperiment, "stepSize", None)
    for step in (of_fmu, of_experiment):
        if step and float(step) > 0.0:
            return float(step)
    return None
