"""Policies as laws of the benchmark, scored like any other law.

    trace = smc.run(smc.Scenario(plant="duffing", law=smc.policy(network)))

A policy observes the same positions and velocities as in an environment. On a plant of several
channels it is called once per channel, with that channel's observation. State that a plain function
keeps elsewhere is shared by all runs. A policy is called in Python.
"""

import copy
import dataclasses
import functools
import hashlib
import importlib
import io
import math
import os
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import numpy as np

from smc_mujoco.common.aliases import Array
from smc_mujoco.common.constraints import OneOf, constrained
from smc_mujoco.common.data import frozen_data
from smc_mujoco.common.errors import ScenarioError, one_line, shown
from smc_mujoco.common.files import reading
from smc_mujoco.common.jit import Uncompiled
from smc_mujoco.control.law import Law, Measurement, law_function

Act = Callable[[np.ndarray], Any]
CALLABLE_CURE = "give a callable from an observation to an action"
FORMATS = {  # suffix of a file -> library that reads it, cure if it does not
    ".onnx": ("onnxruntime", "give what torch.onnx.export writes"),
    ".pt2": ("torch", "give what torch.export.save writes"),
}
UNITS = "u_max", "SI"  # of an action: a fraction of u_max, or N and N m
ONNX_DTYPES = {
    "tensor(float)": np.float32,
    "tensor(double)": np.float64,
    "tensor(float16)": np.float16,
}


@frozen_data
class Policy(Uncompiled):
    """The function of a policy's law."""

    act: Act
    name: str  # of the law
    reference: bool  # whether r, r' and r'' are at the end of the observation
    units: str  # of the action, one of UNITS

    why = "is Python code that does not compile"

    @property
    def __name__(self) -> str:
        """The law's name."""
        return self.name

    def __call__(self, y: Measurement, gains: Any, memory: Array) -> tuple[float, float]:
        """Return u, and 0 for s."""
        scale = y.limit if self.units == "u_max" else 1.0
        if math.isinf(scale):
            raise ValueError(
                'its action is a fraction of u_max, and u_max is inf: give u_max, or units="SI"'
            )
        if any((y.q, y.dq, y.fq, y.gq)):
            state = [y.x, y.q, y.v, y.dq]
        else:
            state = [y.x, y.v]
        if self.reference:
            state += [y.r, y.dr, y.ddr]
        observation = np.array(state)
        u = np.asarray(self.act(observation), float).ravel()
        if len(u) != 1:
            raise ValueError(
                f"{self.name} gave an action of {len(u)} numbers; a law gives one a channel"
            )
        return float(u[0]) * scale, 0.0

    def fresh(self) -> "Policy":
        """Return the policy with a copy of its object, and warn if that cannot be copied."""
        try:
            return dataclasses.replace(self, act=copy.deepcopy(self.act))
        except Exception as error:
            warnings.warn(
                f"policy {self.name!r} cannot be copied ({one_line(str(error))}), so that "
                "channels and runs share it: give an object that copy.deepcopy copies, or a "
                "function only of the observation",
                stacklevel=2,
            )
            return self


class Controller(Policy):
    """The function of the law of an object with opensmc's method compute(t, x, xref), which gives
    u, or u and a dict.

    xref is (r, r', r''), u is in N or N m, and the entry "s" of the dict is the law's s.
    """

    def __call__(self, y: Measurement, gains: Any, memory: Array) -> tuple[float, float]:
        """Return u and s."""
        answer = self.act.compute(y.t, np.array([y.x, y.v]), np.array([y.r, y.dr, y.ddr]))  # pyright: ignore[reportFunctionMemberAccess]
        u, info = answer if isinstance(answer, tuple) else (answer, {})
        number = np.asarray(u, float).item()
        return float(number), float(info.get("s", 0.0))


@frozen_data
class File:
    """A policy in a file. Two are equal if their content is."""

    path: str = dataclasses.field(compare=False)
    digest: str  # of its bytes

    def __call__(self, observation: Array) -> Any:
        """Return the action."""
        return load_network(self)(observation)


@functools.lru_cache(maxsize=8)
def load_network(file: File) -> Act:
    """Return the network in a file."""
    path = Path(file.path)
    if not path.is_file() or _digest(path) != file.digest:
        raise ScenarioError(f"policy {path.name!r} is gone or has changed: call smc.policy again")
    name, cure = FORMATS[path.suffix]
    library = _library(name, path.name)
    read = _onnx if name == "onnxruntime" else _torch
    try:
        return read(library, path)
    except ScenarioError:
        raise
    except Exception as error:
        raise ScenarioError(
            f"policy {path.name!r} cannot be read ({one_line(str(error))}): {cure}"
        ) from error


def _onnx(onnxruntime: ModuleType, path: Path) -> Act:
    """Return the network in an ONNX file."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1  # more would only spin: the batch is one observation
    session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    inputs = session.get_inputs()
    dtype = ONNX_DTYPES.get(inputs[0].type)
    shape = list(inputs[0].shape)
    fits = len(inputs) == 1 and dtype is not None and len(shape) == 2
    if not fits or (isinstance(shape[0], int) and shape[0] != 1):
        tensors = []
        for tensor in inputs:
            tensors.append(f"{tensor.name} {tensor.type} {tensor.shape}")
        text = ", ".join(tensors)
        raise ScenarioError(
            f"policy {path.name!r} takes {text}: export it for one input of floats, of shape (1, n)"
        )
    name = inputs[0].name
    return lambda observation: session.run(None, {name: observation[None].astype(dtype)})[0]


def _torch(torch: ModuleType, path: Path) -> Act:
    """Return the network in a torch file, in the mode of its export."""
    program = torch.export.load(str(path))
    return functools.partial(_forward, torch, program.module())


@dataclasses.dataclass(frozen=True, eq=False)
class Network:
    """A copy of a torch module, on the CPU and in evaluation mode.

    Further training does not change it.
    """

    module: Any  # the copy
    predicts: bool = False  # whether to call its method `predict`, as of stable-baselines3

    def __call__(self, observation: Array) -> Any:
        """Return the action."""
        if self.predicts:
            return _predict(self.module, observation)
        return _forward(sys.modules["torch"], self.module, observation)

    def __deepcopy__(self, memo: dict[int, Any]) -> "Network":
        """Return a network of its own, as a module may keep state from call to call."""
        _reset_distribution(self.module)
        return Network(copy.deepcopy(self.module, memo), self.predicts)

    def __reduce__(self) -> tuple:
        """Return what pickle and run keys contain: the module's bytes, its classes, and torch's
        version.
        """
        torch = sys.modules["torch"]
        file = io.BytesIO()
        _reset_distribution(self.module)
        torch.save(self.module, file)
        classes = {type(part) for part in self.module.modules()}
        ordered = sorted(classes, key=lambda kind: (kind.__module__, kind.__qualname__))
        return _unpickled, (file.getvalue(), tuple(ordered), torch.__version__, self.predicts)


def _unpickled(content: bytes, classes: tuple[type, ...], version: str, predicts: bool) -> Network:
    torch = _library("torch", "network")
    module = torch.load(io.BytesIO(content), weights_only=False)
    return Network(module, predicts)


@constrained
def policy(
    act: Any,
    *,
    reference: bool = False,
    name: str | None = None,
    units: Annotated[str, OneOf(names=(*UNITS,))] = "u_max",
) -> Law:
    """Return a policy as a law.

        law = smc.policy(lambda seen: -seen[0] - seen[1], name="spring and damper")
        smc.run(smc.Scenario(plant="duffing", law=law, duration=0.5))

    Args:
      act: one of
        - a callable from an observation to an action;
        - an object with a method `predict`, such as a model of stable-baselines3, called for its
          deterministic action;
        - a torch module, which is copied and put in evaluation mode, as is the policy of a model;
        - the path of a file of ONNX (.onnx) or of torch.export (.pt2).
      reference: whether r, r' and r'' are at the end of the observation, as in the task `track`.
      name: of the law; default: the object's name.
      units: of the action: "u_max", a fraction of u_max; or "SI", N or N m. Either is clipped to
        the bound.

    The observation is (x, v), or (x, q, v, q') for a joint that moves another one: a float64 array
    of a single channel. ONNX and torch get it as a batch of one in the network's own type. An
    object that keeps state, such as an adaptive gain, is copied for each channel of each run, which
    starts from it as it was given.

    A policy that simulates ahead must make and step its environments in the thread that calls it.
    In another thread they and the run would wait for each other forever.

    Returns:
      A Law of one channel.

    Raises:
      ScenarioError: none of these, no such file, a library that is not installed, or other units.
    """
    try:
        function, its_name = _callable(act)
    except ScenarioError:
        raise
    except Exception as error:  # of the object itself, when it is inspected
        raise ScenarioError(f"policy is {shown(act)}: {CALLABLE_CURE}") from error
    if name is None:
        name = its_name
    return law_function(Policy(function, name, reference, units))()


def controller(act: Any, *, name: str | None = None) -> Law:
    """Return an object with opensmc's method `compute` as a law; each channel of each run has its
    own copy.
    """
    if name is None:
        name = type(act).__name__
    return law_function(Controller(act, name, reference=True, units="SI"))()


def _callable(act: Any) -> tuple[Act, str]:
    """Return a policy as a callable on arrays, and its name."""
    if isinstance(act, str | os.PathLike):
        path = Path(act)
        if path.suffix not in FORMATS:
            raise ScenarioError(
                f"policy is {path.name!r}: give a callable, or a file of {', '.join(FORMATS)}"
            )
        with reading(path, "policy", "give the path of a file that a library wrote"):
            file = File(str(path.resolve()), _digest(path))
        load_network(file)
        return file, path.stem
    torch = sys.modules.get("torch")
    control = sys.modules.get("control")
    name = type(act).__name__
    if control is not None and isinstance(act, control.InputOutputSystem):
        raise ScenarioError(
            f"policy is a {name} of python-control: give smc.law_from a linear system, such as "
            "control.linearize(system, x0, u0)"
        )
    predicts = callable(getattr(act, "predict", None))
    if predicts and not callable(act):  # a model of stable-baselines3 predicts by its policy
        act = getattr(act, "policy", act)
    elif not callable(act):
        raise ScenarioError(f"policy is {shown(act)}: {CALLABLE_CURE}")
    if torch is None or not isinstance(act, torch.nn.Module):
        function = act if callable(act) else functools.partial(_predict, act)
        return function, getattr(act, "__name__", name)
    try:
        _reset_distribution(act)
        module: Any = copy.deepcopy(act)
        return Network(module.to("cpu").eval(), predicts), name
    except Exception as error:
        cure = "give a file, by torch.onnx.export"
        raise ScenarioError(
            f"policy {name!r} cannot be copied ({one_line(str(error))}): {cure}"
        ) from error


def _predict(model: Any, observation: Array) -> Any:
    """Return the action that a model predicts: the result of `predict`, or the first of a pair."""
    action = model.predict(observation, deterministic=True)
    if isinstance(action, tuple):
        return action[0]
    return action


def _forward(torch: ModuleType, module: Any, observation: Array) -> Array:
    """Return the output of a torch module for an observation, converted to the type of its
    parameters.
    """
    dtype = next((p.dtype for p in module.parameters() if p.is_floating_point()), torch.float32)
    with torch.no_grad():
        action = module(torch.as_tensor(observation[None], dtype=dtype))
    if isinstance(action, tuple | list | dict):
        raise TypeError(
            f"it gave a {type(action).__name__}, not an action: wrap it in one that gives only that"
        )
    return action.double().numpy()


def _reset_distribution(module: Any) -> None:
    """Let a policy of stable-baselines3 predict at 0, because it stores the distribution of its
    last action.

    After training that distribution has a graph, which cannot be copied. After a run it depends on
    the run.
    """
    space = getattr(module, "observation_space", None)
    if space is not None and hasattr(module, "predict"):
        _predict(module, np.zeros(space.shape, space.dtype))


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _library(name: str, what: str) -> ModuleType:
    """Import a library, or raise a ScenarioError that says how to install it."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ScenarioError(
            f"policy {what!r} needs {name} ({error}): pip install {name}"
        ) from error
