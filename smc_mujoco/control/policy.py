"""A policy as a law of the benchmark: scored like any other.

    trace = smc.run(smc.Scenario(plant="duffing", law=smc.policy(network)))

A policy sees the positions and velocities that it has in an environment; in a network it is asked channel by channel,
each with its own. It is to be a function of the observation alone: what it remembered would go from channel to channel
and from run to run. It is Python, and so such runs take the reference loop.
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
LIBRARIES = {".onnx": "onnxruntime", ".pt": "torch", ".pth": "torch", ".ts": "torch", ".pt2": "torch"}
CURE = "give a callable from an observation to an action"
SCRIPT = "give TorchScript, as torch.jit.script(module).save writes it, and no state_dict"
CURES = {".onnx": "give what torch.onnx.export writes", ".pt2": "give what torch.export.save writes"}  # else SCRIPT
ONNX = {"tensor(float)": np.float32, "tensor(double)": np.float64, "tensor(float16)": np.float16}


@dataclasses.dataclass(frozen=True)
class Policy(Uncompiled):
    """The function of a policy's law.

    Attributes:
      act: what is asked.
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
        """u and s, which is 0."""
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
    """A policy that a file holds: plain data, so that runs under other files are told apart, and may be sent away."""

    path: str
    digest: str  # of its bytes

    def __call__(self, observation: np.ndarray) -> Any:
        """The action."""
        return opened(self)(observation)


@functools.lru_cache(maxsize=8)
def opened(file: File) -> Act:
    """The file's network, ready to be asked.

    Raises:
      ScenarioError: its library is not installed, or does not read it; it asks for more than an observation; it is
        another than it was.
    """
    path = Path(file.path)
    if not path.is_file() or _digest(path) != file.digest:
        raise ScenarioError(f"policy {path.name!r} is gone, or another than it was: call smc.policy again")
    library = _library(LIBRARIES[path.suffix], path.name)
    try:
        return (_of_onnx if path.suffix == ".onnx" else _of_torch_file)(library, path)
    except ScenarioError:
        raise
    except Exception as error:
        why = " ".join(str(error).split())[:200]
        cure = CURES.get(path.suffix, SCRIPT)
        raise ScenarioError(f"policy {path.name!r} cannot be read ({why}): {cure}") from error


@dataclasses.dataclass(frozen=True, eq=False)
class Network:
    """A torch module as it is now, on the CPU and as in evaluation: training it on changes no law.

    Attributes:
      module: the torch module.
      predicts: whether its method `predict` is asked, as that of a policy of stable-baselines3 is, and not itself.
    """

    module: Any
    predicts: bool = False

    def __call__(self, observation: np.ndarray) -> Any:
        """The action."""
        if self.predicts:
            return _predicted(self.module, observation)
        return _asked(sys.modules["torch"], self.module, observation)

    def __reduce__(self) -> tuple:
        """For pickle, and for what tells runs apart: its bytes, the classes it is made of, and torch's version."""
        torch, held = sys.modules["torch"], io.BytesIO()
        _settle(self.module)
        torch.save(self.module, held)
        kinds = {type(part) for part in self.module.modules()}
        ordered = sorted(kinds, key=lambda kind: (kind.__module__, kind.__qualname__))
        return _restored, (held.getvalue(), tuple(ordered), torch.__version__, *[True] * self.predicts)


def _restored(held: bytes, kinds: tuple[type, ...], version: str, predicts: bool = False) -> Network:
    """What `Network.__reduce__` tells of."""
    return Network(_library("torch", "network").load(io.BytesIO(held), weights_only=False), predicts)


def policy(act: Any, *, reference: bool = False) -> Law:
    """A policy as a law.

    Args:
      act: a callable from an observation to an action, in parts of its limit, beyond which it saturates; what has
        such a method `predict`, as a model of stable-baselines3, asked for its deterministic action; a torch module,
        taken as it is now and put in evaluation mode, and so is the policy of a model; or the path of a file of onnx
        (.onnx), of torch.export (.pt2) or of TorchScript (.pt, .pth, .ts).
      reference: whether its observation ends in r, r', r'', as that of the task `track` does.

    The observation is x, v, or x, q, v, q' of a joint with one that moves with it: a float64 array of a single
    channel, for onnx and torch a batch of one in the network's own type. A policy that looks ahead makes and steps its
    environments in its own thread: in others they wait for the run to end, and it for them.

    Raises:
      ScenarioError: nothing of these, no such file, or a library that is not installed.
    """
    try:
        asked, name = _callable(act)
    except ScenarioError:
        raise
    except Exception as error:  # of a user's object that does not even say whether it can be called
        raise ScenarioError(f"policy is {shown(act)}: {CURE}") from error
    return law_function(Policy(asked, name, reference))()


def _callable(act: Any) -> tuple[Act, str]:
    """A policy as a callable on arrays, and its name."""
    if isinstance(act, str | os.PathLike):
        path = Path(act)
        if path.suffix not in LIBRARIES:
            raise ScenarioError(f"policy is {path.name!r}: give a callable, or a file of {', '.join(LIBRARIES)}")
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
        return (act if callable(act) else functools.partial(_predicted, act)), getattr(act, "__name__", name)
    try:
        _settle(act)
        module: Any = copy.deepcopy(act)
        return Network(module.to("cpu").eval(), predicts), name
    except Exception as error:
        why = " ".join(str(error).split())[:200]
        raise ScenarioError(f"policy {name!r} cannot be copied ({why}): give a file, by torch.onnx.export") from error


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _library(name: str, what: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ScenarioError(f"policy {what!r} needs {name} ({error}): pip install {name}") from error


def _of_onnx(onnxruntime: ModuleType, path: Path) -> Act:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1  # a batch of one is not for several, which would spin meanwhile
    session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    taken = session.get_inputs()
    kind, shape = ONNX.get(taken[0].type), list(taken[0].shape)
    if len(taken) != 1 or kind is None or len(shape) != 2 or (shape[0] != 1 and isinstance(shape[0], int)):
        found = ", ".join(f"{one.name} {one.type} {one.shape}" for one in taken)
        raise ScenarioError(f"policy {path.name!r} takes {found}: export it for one input of floats, of shape (1, n)")
    return lambda observation: session.run(None, {taken[0].name: observation[None].astype(kind)})[0]


def _of_torch_file(torch: ModuleType, path: Path) -> Act:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # TorchScript is old, and the file is what it is
        if path.suffix == ".pt2":
            module = torch.export.load(str(path)).module()  # which is what it was exported as, and refuses eval()
        else:
            module = torch.jit.load(str(path), map_location="cpu").eval()
    return functools.partial(_asked, torch, module)


def _predicted(model: Any, observation: np.ndarray) -> Any:
    """The action that a model gives: `predict` returns it alone, or first of a pair with what it remembers."""
    found = model.predict(observation, deterministic=True)
    return found[0] if isinstance(found, tuple) else found


def _settle(module: Any) -> None:
    """Ask a policy of stable-baselines3 for an action at 0: of its last question it keeps the distribution.

    After training that has a graph, which cannot be copied, and after a run it differs from run to run.
    """
    space = getattr(module, "observation_space", None)
    if space is not None and hasattr(module, "predict"):
        _predicted(module, np.zeros(space.shape, space.dtype))


def _asked(torch: ModuleType, module: Any, observation: np.ndarray) -> np.ndarray:
    """What a torch module makes of an observation, given in the type of its own numbers."""
    kind = next((p.dtype for p in module.parameters() if p.is_floating_point()), torch.float32)
    with torch.no_grad():
        found = module(torch.as_tensor(observation[None], dtype=kind))
    if isinstance(found, tuple | list | dict):
        raise TypeError(f"it gave a {type(found).__name__}, not an action: wrap it in one that gives the action alone")
    return found.double().numpy()
