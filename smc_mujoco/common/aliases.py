"""Short names of types that many signatures share."""

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

AnyPath = str | os.PathLike[str]
Array = np.ndarray
ArrayPair = tuple[Array, Array]
Data = Mapping[str, Any]  # values by name, to be read
Fields = dict[str, Any]  # the same, to be filled
Floats = tuple[float, ...]
Names = tuple[str, ...]
Numbers = Mapping[str, float]  # by name
Pair = tuple[float, float]
