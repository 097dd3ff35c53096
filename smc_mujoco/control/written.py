"""Laws that are written out as text: straight Python without loops, compiled like any other law."""

import dataclasses
import linecache
from typing import Any

import numpy as np

from smc_mujoco.common.cached import cached_property
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control.law import Law, law_function
from smc_mujoco.control.units import Gain, Unit

Matrix = tuple[tuple[float, ...], ...]


class WrittenLaw:
    """The function of a law that its fields write; a frozen dataclass with a `name`.

    It is equal to another one with the same fields.
    """

    name: str

    @cached_property
    def text(self) -> str:
        """The law in Python: a function `controller`."""
        raise NotImplementedError

    @property
    def __name__(self) -> str:
        """The law's name."""
        return self.name

    def __call__(self, y: Any, gains: Any, memory: Any) -> tuple[Any, Any]:
        """Return u and s."""
        return self.py_func(y, gains, memory)

    def __reduce__(self) -> tuple:
        """Pickle the fields. The function is written out again."""
        return type(self), tuple(getattr(self, field.name) for field in dataclasses.fields(self))  # pyright: ignore[reportArgumentType] see the class

    @cached_property
    def py_func(self) -> Any:
        """The compiled text, as a plain function of Python."""
        text = self.text
        file = f"<controller {self.name} {hash(self):x}>"
        space = {"__name__": "law_from_control", "np": np}
        lines = text.splitlines(keepends=True)
        linecache.cache[file] = len(text), None, lines, file  # for the translation to C
        exec(compile(text, file, "exec"), space)
        return space["controller"]


@dataclasses.dataclass(frozen=True)
class StateFeedback(WrittenLaw):
    """The function of u = -K (x - r, v - r'), of all channels of a plant."""

    K: Matrix  # (driven, 2n): positions first, the channels in the plant's order
    name: str

    @property
    def joints(self) -> int:
        """The number of channels that it reads."""
        return len(self.K[0]) // 2

    @cached_property
    def text(self) -> str:
        """The law in Python."""
        n = self.joints
        lines = [f"u = np.zeros({len(self.K)})", f"s = np.zeros({len(self.K)})"]
        for i, row in enumerate(self.K):
            terms = []
            for j, value in enumerate(row):
                if value:
                    terms.append(f"{value!r} * y.{'e' if j < n else 'de'}[{j % n}]")
            lines += [
                f"u[{i}] = -gains.scale * ({' + '.join(terms) or '0.0'})",
                f"s[{i}] = y.e[{i}]",
            ]
        body = "".join(f"    {line}\n" for line in [*lines, "return u, s"])
        return f"def controller(y, gains, memory):\n{body}"


def state_feedback(K: np.ndarray, name: str) -> Law:
    """Return the law u = -K (x - r, v - r') of a plant with n channels, of which some are driven.

    Args:
      K: (driven, 2n), N or N m per rad or m, and per rad/s or m/s; finite.
      name: of the law.
    """
    if not np.isfinite(K).all():
        raise ScenarioError(f"K of {name!r} is not finite: give finite gains")
    function = StateFeedback(tuple(map(tuple, K.tolist())), name)
    gains = {"scale": Gain(1.0, Unit(), positive=True, shared=True)}
    return law_function(joint=True, gains=gains, family="linear", continuous=True)(function)()
