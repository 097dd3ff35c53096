"""A policy as a law of the benchmark: scored like any other.

    trace = smc.run(smc.Scenario(plant="duffing", law=smc.policy(network)))

A policy sees the positions and velocities that it has in an environment. In a network it is asked for each channel,
with that channel's own. It must be a function of the observation alone: a memory of its own would go from channel to
channel and from run to run. It is Python, so its runs take the reference loop.
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
from typing import Any

import numpy as np

from smc_mujoco.common.errors import ScenarioError, shown
from smc_mujoco.common.jit import Uncompiled
from smc_mujoco.control.law import Law, Measurement, law_function

Act = Callable[[np.ndarray], Any]
CURE = "give a callable from an observation to an action"
SCRIPT = "give TorchScript, as torch.jit.script(module).save writes it, and no state_dict"
FORMATS = {  # suffix of a file -> library that reads it, what to give where it does not
    ".onnx": ("onnxruntime", "give what torch.onnx.export writes"),
    ".pt": ("torch", SCRIPT),
    ".pth": ("torch", SCRIPT),
    ".ts": ("torch", SCRIPT),
    ".pt2": ("torch", "give what torch.export.save writes"),
}
ONNX = {"tensor(float)": np.float32, "tensor(double)": np.float64, "tensor(float16)": np.float16}


@dataclasses.dataclass(frozen=True)
class Policy(Uncompiled):
    """The function of a policy's law.

    Attributes:
      act: the policy as a callable.
      name: of the law.
      reference: whether the observation ends in r, r', r''.
    """

    act: Act
    name: str
    reference: bool

    why = "is a policy, which is Python: several times slower than a law that compiles, and on one core"

    @property
    def __name__(self) -> str:
        """The law's name."""
        return self.name

    def __call__(self, y: Measurement, gains: Any, memory: np.ndarray) -> tuple[float, float]:
        """Return u, and 0 for s."""
        if math.isinf(y.limit):
            raise ValueError("its action is in parts of a limit, and u_max is inf")
        state = [y.x, y.q, y.v, y.dq] if any((y.q, y.dq, y.fq, y.gq)) else [y.x, y.v]
        given = np.array([*state, y.r, y.dr, y.ddr] if self.reference else state)
        u = np.asarray(self.act(given), float).ravel()
        if len(u) != 1:
            raise ValueError(f"{self.name} gave an action of {len(u)} numbers; a law gives one a channel")
        return float(u[0]) * y.limit, 0.0


@dataclasses.dataclass(frozen=True)
class File:
    """A policy in a file: plain data, which is pickled, and which differs as the file does."""

    path: str
    digest: str  # of its bytes

    def __call__(self, observation: np.ndarray) -> Any:
        """Return the action."""
        return opened(self)(observation)


@functools.lru_cache(maxsize=8)
def opened(file: File) -> Act:
    """Return the network in a file.

    Raises:
      ScenarioError: its library is not installed, or does not read it; it takes more than an observation; the file
        has changed.
    """
    path = Path(file.path)
    if not path.is_file() or _digest(path) != file.digest:
        raise ScenarioError(f"policy {path.name!r} is gone, or another than it was: call smc.policy again")
    name, cure = FORMATS[path.suffix]
    library = _library(name, path.name)
    try:
        return (_onnx if name == "onnxruntime" else _torch)(library, path)
    except ScenarioError:
        raise
    except Exception as error:
        raise ScenarioError(f"policy {path.name!r} cannot be read ({_line(error)}): {cure}") from error


def _onnx(onnxruntime: ModuleType, path: Path) -> Act:
    """Return the network in a file of onnx."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1  # a batch of one gains nothing from more, which would spin meanwhile
    session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    taken = session.get_inputs()
    kind, shape = ONNX.get(taken[0].type), list(taken[0].shape)
    if len(taken) != 1 or kind is None or len(shape) != 2 or (shape[0] != 1 and isinstance(shape[0], int)):
        found = ", ".join(f"{one.name} {one.type} {one.shape}" for one in taken)
        raise ScenarioError(f"policy {path.name!r} takes {found}: export it for one input of floats, of shape (1, n)")
    return lambda observation: session.run(None, {taken[0].name: observation[None].astype(kind)})[0]


def _torch(torch: ModuleType, path: Path) -> Act:
    """Return the network in a file of torch."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # that of TorchScript
        if path.suffix == ".pt2":
            module = torch.export.load(str(path)).module()  # in the mode it was exported in: it refuses eval()
        else:
            module = torch.jit.load(str(path), map_location="cpu").eval()
    return functools.partial(_forward, torch, module)


@dataclasses.dataclass(frozen=True, eq=False)
class Network:
    """A copy of a torch module, on the CPU and in evaluation mode: training goes on without changing the law.

    Attributes:
      module: the copy.
      predicts: whether its method `predict` is asked, as that of a policy of stable-baselines3, and not itself.
    """

    module: Any
    predicts: bool = False

    def __call__(self, observation: np.ndarray) -> Any:
        """Return the action."""
        if self.predicts:
            return _predict(self.module, observation)
        return _forward(sys.modules["torch"], self.module, observation)

    def __reduce__(self) -> tuple:
        """Return what pickle and run keys hold: the module's bytes, its classes, and torch's version."""
        torch, held = sys.modules["torch"], io.BytesIO()
        _settle(self.module)
        torch.save(self.module, held)
        kinds = {type(part) for part in self.module.modules()}
        ordered = sorted(kinds, key=lambda kind: (kind.__module__, kind.__qualname__))
        return _restored, (held.getvalue(), tuple(ordered), torch.__version__, *[True] * self.predicts)


def _restored(held: bytes, kinds: tuple[type, ...], version: str, predicts: bool = False) -> Network:
    """Return the Network that `Network.__reduce__` describes."""
    return Network(_library("torch", "network").load(io.BytesIO(held), weights_only=False), predicts)


def policy(act: Any, *, reference: bool = False) -> Law:
    """Return a policy as a law.

    Args:
      act: one of: a callable from an observation to an action in parts of its limit, beyond which it saturates; an
        object with a method `predict`, as a model of stable-baselines3, asked for its deterministic action; a torch
        module, which is copied and put in evaluation mode, as is the policy of a model; the path of a file of onnx
        (.onnx), of torch.export (.pt2) or of TorchScript (.pt, .pth, .ts).
      reference: whether its observation ends in r, r', r'', as that of the task `track` does.

    The observation is x, v, or x, q, v, q' of a joint with one that moves with it: a float64 array of a single
    channel, for onnx and torch a batch of one in the network's own type. A policy that looks ahead makes and steps its
    environments in its own thread: in another thread they would wait for the run to end, and the run for them.

    Raises:
      ScenarioError: none of these, no such file, or a library that is not installed.
    """
    try:
        asked, name = _callable(act)
    except ScenarioError:
        raise
    except Exception as error:  # the object's own: it does not even say whether it can be called
        raise ScenarioError(f"policy is {shown(act)}: {CURE}") from error
    return law_function(Policy(asked, name, reference))()


def _callable(act: Any) -> tuple[Act, str]:
    """Return a policy as a callable on arrays, and its name."""
    if isinstance(act, str | os.PathLike):
        path = Path(act)
        if path.suffix not in FORMATS:
            raise ScenarioError(f"policy is {path.name!r}: give a callable, or a file of {', '.join(FORMATS)}")
        if not path.is_file():
            raise ScenarioError(f"no policy {str(path)!r}: give the path of a file")
        file = File(str(path.resolve()), _digest(path))
        opened(file)  # now, not in the run
        return file, path.stem
    torch, name = sys.modules.get("torch"), type(act).__name__
    predicts = callable(getattr(act, "predict", None))
    if predicts and not callable(act):  # a model of stable-baselines3 has its policy's own predict
        act = getattr(act, "policy", act)
    elif not callable(act):
        raise ScenarioError(f"policy is {shown(act)}: {CURE}")
    if torch is None or not isinstance(act, torch.nn.Module):
        return (act if callable(act) else functools.partial(_predict, act)), getattr(act, "__name__", name)
    try:
        _settle(act)
        module: Any = copy.deepcopy(act)
        return Network(module.to("cpu").eval(), predicts), name
    except Exception as error:
        cure = "give a file, by torch.onnx.export"
        raise ScenarioError(f"policy {name!r} cannot be copied ({_line(error)}): {cure}") from error


def _predict(model: Any, observation: np.ndarray) -> Any:
    """Return the action that a model predicts: what `predict` returns, or the first of a pair."""
    found = model.predict(observation, deterministic=True)
    return found[0] if isinstance(found, tuple) else found


def _forward(torch: ModuleType, module: Any, observation: np.ndarray) -> np.ndarray:
    """Return the output of a torch module for an observation, which it gets in the type of its own numbers."""
    kind = next((p.dtype for p in module.parameters() if p.is_floating_point()), torch.float32)
    with torch.no_grad():
        found = module(torch.as_tensor(observation[None], dtype=kind))
    if isinstance(found, tuple | list | dict):
        raise TypeError(f"it gave a {type(found).__name__}, not an action: wrap it in one that gives the action alone")
    return found.double().numpy()


def _settle(module: Any) -> None:
    """Ask a policy of stable-baselines3 for an action at 0, because it keeps the distribution of its last answer.

    After training the distribution has a graph, which cannot be copied; after a run it differs from run to run.
    """
    space = getattr(module, "observation_space", None)
    if space is not None and hasattr(module, "predict"):
        _predict(module, np.zeros(space.shape, space.dtype))


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _line(error: Exception) -> str:
    """Return the text of another library's error on one line."""
    return " ".join(str(error).split())[:200]


def _library(name: str, what: str) -> ModuleType:
    """Return a library, imported, or raise a ScenarioError that says how to install it."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ScenarioError(f"policy {what!r} needs {name} ({error}): pip install {name}") from error
