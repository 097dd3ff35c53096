"""A policy as a law of the benchmark: scored like any other.

    trace = smc.run(smc.Scenario(plant="duffing", law=smc.policy(network)))

A policy sees the positions and velocities that it has in an environment; in a network it is asked channel by channel,
each with its own. It is Python, and so such runs take the plain loop.
"""

import dataclasses
import functools
import hashlib
import importlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from smc_mujoco.errors import ScenarioError, shown
from smc_mujoco.law import Law, Measurement, law_function

Act = Callable[[np.ndarray], Any]
LIBRARIES = {".onnx": "onnxruntime", ".pt": "torch", ".pth": "torch", ".ts": "torch"}


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
      ScenarioError: its library is not installed, or does not read it.
    """
    path = Path(file.path)
    library = _library(LIBRARIES[path.suffix], path.name)
    try:
        return (_of_onnx if path.suffix == ".onnx" else _of_torch_file)(library, path)
    except Exception as error:
        why = " ".join(str(error).split())[:200]
        raise ScenarioError(f"policy {path.name!r} cannot be read ({why}): export it again") from error


def policy(act: Any, *, reference: bool = False) -> Law:
    """A policy as a law.

    Args:
      act: a callable from an observation to an action, in parts of u_max; a torch module; or the path of a file of onnx
        (.onnx) or of TorchScript (.pt, .pth, .ts).
      reference: whether its observation ends in r, r', r'', as that of the task `track` does.

    The observation is x, v, or x, q, v, q' of a joint with one that moves with it: a float64 array of a single
    channel, for onnx and torch a batch of one in the file's own type, for torch float32.

    Raises:
      ScenarioError: nothing of these, no such file, or a library that is not installed.
    """
    asked, name = _callable(act)

    def policy(y: Measurement, gains: Any, memory: np.ndarray) -> tuple[float, float]:
        state = [y.x, y.v] if y.gq == 0.0 else [y.x, y.q, y.v, y.dq]
        given = np.array([*state, y.r, y.dr, y.ddr] if reference else state)
        u = np.asarray(asked(given), float).ravel()
        if len(u) != 1:
            raise ValueError(f"{name} gave an action of {len(u)} numbers; a law gives one a channel")
        return float(u[0]) * y.limit, 0.0

    policy.__name__ = name
    return law_function(policy)()


def _callable(act: Any) -> tuple[Act, str]:
    """A policy as a callable on arrays, and its name."""
    if isinstance(act, str | os.PathLike):
        path = Path(act)
        if path.suffix not in LIBRARIES:
            raise ScenarioError(f"policy is {path.name!r}: give a callable, or a file that ends in .onnx, .pt or .ts")
        if not path.is_file():
            raise ScenarioError(f"no policy {str(path)!r}: give the path of a file")
        file = File(str(path.resolve()), hashlib.sha256(path.read_bytes()).hexdigest())
        opened(file)  # now, not in the run
        return file, path.stem
    if not callable(act):
        raise ScenarioError(f"policy is {shown(act)}: give a callable from an observation to an action")
    torch = sys.modules.get("torch")
    if torch is not None and isinstance(act, torch.nn.Module):
        return _of_torch(torch, act), type(act).__name__
    return act, getattr(act, "__name__", type(act).__name__)


def _library(name: str, what: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ScenarioError(f"policy {what!r} needs {name} ({error}): pip install {name}") from error


def _of_onnx(onnxruntime: ModuleType, path: Path) -> Act:
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    taken = session.get_inputs()[0]
    kind = np.float64 if taken.type == "tensor(double)" else np.float32
    return lambda observation: session.run(None, {taken.name: observation[None].astype(kind)})[0]


def _of_torch_file(torch: ModuleType, path: Path) -> Act:
    return _of_torch(torch, torch.jit.load(str(path), map_location="cpu").eval())


def _of_torch(torch: ModuleType, module: Any) -> Act:
    def act(observation: np.ndarray) -> np.ndarray:
        with torch.no_grad():
            return module(torch.as_tensor(observation[None], dtype=torch.float32)).numpy()

    return act
