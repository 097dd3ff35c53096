"""The shared library of a law in C, through ctypes: its function, its constants, and what it asks
for while it runs.
"""

import ctypes
import itertools
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

BEYOND = 2**40  # codes of glue.c from here on
FAULTS = {  # code -> fault, formatted with the size of memory
    BEYOND: "writes beyond the {} numbers of its memory",
    BEYOND + 1: "writes beyond the numbers of out",
    BEYOND + 3: "asks for the Jacobian of a tip, and there is none",
    BEYOND + 4: "changes its measurement",
}
INTS = (
    "smc_law_memory",
    "smc_law_real",
    "smc_law_degree",
    "smc_law_modelled",
    "smc_mujoco_joints",
)
DOUBLES = ctypes.POINTER(ctypes.c_double)
# C(x, v) w, or the Jacobian of the tip
ON_REQUEST = ctypes.CFUNCTYPE(ctypes.c_int64, *[DOUBLES] * 4)


class Library(NamedTuple):
    """A law's library on disk."""

    file: Path  # the library, compiled or copied
    path: Path  # the user's file
    symbol: str  # name of the law's function
    warnings: Sequence[str] = ()  # of the compiler


def entry(path: str, symbol: str):
    """Return the law's ctypes function, and its library."""
    modes = getattr(os, "RTLD_NOW", 0) | getattr(os, "RTLD_LOCAL", 0)
    library = ctypes.CDLL(path, mode=modes)
    glued = hasattr(library, "smc_mujoco_entry")
    function = getattr(library, "smc_mujoco_entry" if glued else symbol)
    function.restype = ctypes.c_int64 if glued else ctypes.c_int
    function.argtypes = [DOUBLES] * 4
    return function, library


def facts(library) -> dict[str, Any]:
    """Return the constants of smc_law.h that a library defines, and whether it has the glue."""
    constants: dict[str, Any] = {"glue": hasattr(library, "smc_mujoco_entry")}
    for name in ("smc_law_gains", "smc_law_shared"):
        if hasattr(library, name):
            field = ctypes.c_char.in_dll(library, name)
            text = ctypes.string_at(ctypes.addressof(field))
            constants[name] = text.decode(errors="replace")
    for name in INTS:
        if hasattr(library, name):
            constants[name] = ctypes.c_int.in_dll(library, name).value
    return constants


def set_up(library) -> int:
    """Return the result of smc_setup; 0 if the library has none."""
    if hasattr(library, "smc_setup"):
        return int(library.smc_setup())
    return 0


def set_sizes(library, gains: int, memory: int) -> None:
    """Set the number of gains and of memory slots in the glue, if the library contains it."""
    if hasattr(library, "smc_mujoco_entry"):
        ctypes.c_int.in_dll(library, "smc_mujoco_gains").value = gains
        ctypes.c_int.in_dll(library, "smc_mujoco_memory").value = memory


def doubles(values) -> ctypes.Array:
    """Return an array of C doubles."""
    return (ctypes.c_double * len(values))(*values)


class Requests:
    """C functions that compute what a law of many joints asks for.

    They are valid as long as this object lives.

    `coriolis`: a list w -> the numbers of C(x, v) w. `jacobian` returns the numbers of the tip's
    Jacobian by rows, or raises ValueError if there is none. `address` is that of a table with the
    addresses of both functions and of their parameters, and with the force per unit of u.
    """

    def __init__(self, joints: int, coriolis: Callable, jacobian: Callable):
        def answer(out, function, *arguments) -> int:
            try:
                for i, number in enumerate(function(*arguments)):
                    out[i] = number
            except ValueError:
                return 1
            return 0

        product = ON_REQUEST(lambda w, parameters, memory, out: answer(out, coriolis, w[:joints]))
        tip = ON_REQUEST(lambda nothing, parameters, memory, out: answer(out, jacobian))
        self.joints = joints
        self.functions = (product, tip)
        addresses = []
        for function in self.functions:
            as_pointer = ctypes.cast(function, ctypes.c_void_p)
            addresses.append(float(as_pointer.value or 0))
        self.table = doubles([*addresses, 0.0, 1.0])
        self.address = ctypes.addressof(self.table)


def stored(head, requests: Requests, arrays) -> list[float]:
    """Return the numbers of a joint measurement from t, dt and model and its arrays, see
    `joint_law.measurement_at`.
    """
    sizes = requests.joints, requests.joints
    numbers = itertools.chain.from_iterable(arrays)
    return [*head, float(requests.address), *sizes, *numbers]
