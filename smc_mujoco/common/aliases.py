"""Short names of types that many signatures share.

Those of arrays import numpy, and only where they are asked for, so that a command's help does not.
"""

import os
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

    Array = np.ndarray
    ArrayPair = tuple[Array, Array]

AnyPath = str | os.PathLike[str]
Data = Mapping[str, Any]  # values by name, to be read
Fields = dict[str, Any]  # the same, to be filled
Floats = tuple[float, ...]
Names = tuple[str, ...]
Numbers = Mapping[str, float]  # by name
Pair = tuple[float, float]
# whether to show progress, or a function that is told a text and the share that is done
ProgressTo = bool | Callable[[str, float], object]


def __getattr__(name: str) -> Any:
    """Return the alias of arrays."""
    if name not in ("Array", "ArrayPair"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from numpy import ndarray

    return ndarray if name == "Array" else tuple[ndarray, ndarray]
