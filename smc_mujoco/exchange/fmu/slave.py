"""One instance of an FMU, through FMPy."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

REAL_TYPES = ("Real", "Float64", "Float32")  # as in the names of FMPy's functions
WHOLE_TYPES = ("Integer", "Enumeration", "Int8", "Int16", "Int32", "Int64")
WHOLE_TYPES += ("UInt8", "UInt16", "UInt32", "UInt64")
CONSTANT_TYPES = (*REAL_TYPES, *WHOLE_TYPES, "Boolean")  # types of inputs that may keep one value
# of numbers into values of other types
CONVERTERS = dict.fromkeys(WHOLE_TYPES, round) | {"Boolean": bool}
CURE = "fix the FMU, or its inputs and parameters"


class SlaveFault(Exception):
    """What is wrong with an FMU, in words."""


class VariableGroup(NamedTuple):
    """Variables of one type: their names, value references, and places among the values that are
    set or read.
    """

    kind: str
    names: list[str]
    references: list[int]
    places: list[int]


class Slave:
    """An instance of the FMU in a folder, initialised at a time `start`, s.

    `inputs`, `outputs`: names of its variables, in the order of the values of `step`. `fixed`: name
    -> value of its parameters and of inputs that do not change.
    """

    def __init__(
        self,
        folder: str,
        inputs: Sequence[str],
        outputs: Sequence[str],
        fixed: Mapping[str, float],
        start: float = 0.0,
    ):
        import fmpy
        from fmpy.simulation import instantiate_fmu

        about = fmpy.read_model_description(folder, validate=False)
        self.variables = {variable.name: variable for variable in about.modelVariables}
        self.two = str(about.fmiVersion).startswith("2")
        self.said = list[str]()
        self.inputs = self._by_type(inputs)
        self.outputs = self._by_type(outputs)
        self.fmu: Any = self._called(
            "instantiation", instantiate_fmu, folder, about, "CoSimulation", logger=self._log
        )
        if self.two:
            self._called("fmi2SetupExperiment", self.fmu.setupExperiment, startTime=start)
        for name, value in fixed.items():
            if self.variables[name].causality != "input":
                self._set(self._by_type([name]), [value])
        begins = {} if self.two else {"startTime": start}
        self._called("initialization", self.fmu.enterInitializationMode, **begins)
        for name, value in fixed.items():
            if self.variables[name].causality == "input":
                self._set(self._by_type([name]), [value])
        self._called("initialization", self.fmu.exitInitializationMode)

    def step(self, values: Sequence[float], t: float, length: float) -> list[float]:
        """Set the inputs, make a step from time t, and return the outputs.

        `t` and `length` are in s.
        """
        self._set(self.inputs, values)
        where = {"currentCommunicationPoint": t, "communicationStepSize": length}
        self._called(f"the step from t = {t:g} s", self.fmu.doStep, **where)
        return self._get(self.outputs)

    def close(self) -> None:
        """End the instance."""
        try:
            self.fmu.terminate()
        finally:
            self.fmu.freeInstance()

    def _by_type(self, names: Sequence[str]) -> list[VariableGroup]:
        """Return groups of variables of the same type, which one call sets or reads."""
        groups: dict[str, VariableGroup] = {}
        for place, name in enumerate(names):
            group = groups.setdefault(
                kind := self.variables[name].type, VariableGroup(kind, [], [], [])
            )
            group.names.append(name)
            group.references.append(self.variables[name].valueReference)
            group.places.append(place)
        return list(groups.values())

    def _set(self, groups: Sequence[VariableGroup], values: Sequence[float]) -> None:
        """Set variables to the values at their places."""
        for kind, names, references, places in groups:
            typed = [CONVERTERS.get(kind, float)(values[place]) for place in places]
            if kind == "Enumeration":
                setter = "setInteger" if self.two else "setInt64"
            else:
                setter = f"set{kind}"
            self._called(
                f"setting {', '.join(names)}", getattr(self.fmu, setter), references, typed
            )

    def _get(self, groups: Sequence[VariableGroup]) -> list[float]:
        """Return the values of variables in the order of their places."""
        values = [0.0] * sum(len(group.places) for group in groups)
        for kind, names, references, places in groups:
            read = self._called(
                f"reading {', '.join(names)}", getattr(self.fmu, f"get{kind}"), references
            )
            for place, value in zip(places, read, strict=True):
                values[place] = float(value)
        return values

    def _called(self, what: str, function: Any, *arguments: Any, **named: Any) -> Any:
        """Call a function of FMPy. Raise SlaveFault if it fails, with the FMU's last words."""
        try:
            return function(*arguments, **named)
        except Exception as error:
            why = f"{type(error).__name__}: {error}"
            if self.said:
                why = self.said[-1]
            raise SlaveFault(f"{what} fails ({' '.join(why.split())}): {CURE}") from error

    def _log(self, *words: Any) -> None:
        """Keep what the FMU says; the text is the last argument, in FMI 2 and 3."""
        text = words[-1]
        if isinstance(text, bytes):
            text = text.decode(errors="replace")
        self.said.append(str(text))
