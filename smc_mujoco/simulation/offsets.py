"""Byte offsets of the mjModel and mjData fields that the callback reads and writes.

MuJoCo's introspection names every field of a struct with its C type; C's alignment rules give the
offsets. `offsets()` checks each against a live MjData before anyone dereferences it, so that a MuJoCo whose
layout differs is refused with a sentence instead of read wrongly.
"""

import ctypes
import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
from mujoco.introspect import ast_nodes, structs

from smc_mujoco.common.errors import ScenarioError

_SCALARS = {
    "mjtNum": ctypes.c_double,
    "mjtSize": ctypes.c_int64,
    "mjtBool": ctypes.c_bool,
    "mjtByte": ctypes.c_ubyte,
    "int": ctypes.c_int,
    "float": ctypes.c_float,
    "size_t": ctypes.c_size_t,
    "uintptr_t": ctypes.c_size_t,
    "uint64_t": ctypes.c_uint64,
}


class LayoutError(ScenarioError):
    """This MuJoCo lays out mjData in a way that the callback does not know."""


class Offsets(NamedTuple):
    """Bytes from the start of mjModel to nuserdata, and from the start of mjData to each pointer."""

    nuserdata: int
    qpos: int
    qvel: int
    ctrl: int
    qfrc_applied: int
    xfrc_applied: int
    userdata: int
    sensordata: int
    xipos: int
    xanchor: int
    actuator_force: int
    qfrc_constraint: int


def _ctype(node: object) -> type:
    """The ctypes twin of an introspected C type."""
    match node:
        case ast_nodes.PointerType():
            return ctypes.c_void_p
        case ast_nodes.ArrayType():
            item: Any = _ctype(node.inner_type)
            for extent in reversed(node.extents):
                item = item * extent
            return item
        case ast_nodes.ValueType() if node.name in _SCALARS:
            return _SCALARS[node.name]
        case ast_nodes.ValueType() if node.name in structs.STRUCTS:
            return _struct(node.name)
        case ast_nodes.ValueType() if node.name.startswith("mjt"):  # an enum
            return ctypes.c_int
    raise LayoutError(f"mujoco {mujoco.__version__} has a field of unknown C type {node}: install mujoco 3.17")


def _struct(name: str, wanted: Sequence[str] = ()) -> type[ctypes.Structure]:
    """The ctypes twin of a C struct, up to the last wanted field: what comes after does not move what comes before."""
    fields = [(f.name, f.type) for f in structs.STRUCTS[name].fields]
    if wanted:
        names = [field for field, _ in fields]
        fields = fields[: 1 + max(names.index(field) for field in wanted)]
    return type(name, (ctypes.Structure,), {"_fields_": [(field, _ctype(kind)) for field, kind in fields]})


@functools.cache
def offsets() -> Offsets:
    """The offsets, each checked against a live MjData.

    Raises:
      LayoutError: where the field found at an offset is not the array that MuJoCo's own binding shows.
    """
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="b", mass=1.0, inertia=[1.0, 1.0, 1.0])
    body.add_joint(name="j")
    spec.add_actuator(name="u", target="j", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    spec.add_sensor(name="x", type=mujoco.mjtSensor.mjSENS_JOINTPOS, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname="j")
    spec.nuserdata = 12_345
    model = spec.compile()
    return checked(model, mujoco.MjData(model))


def checked(model: mujoco.MjModel, data: mujoco.MjData) -> Offsets:
    """The introspected offsets after comparing each with what the live model and data show."""
    try:
        struct = _struct("mjData", Offsets._fields[1:])
        nuserdata = _struct("mjModel", ["nuserdata"]).nuserdata.offset
        arrays = [getattr(struct, name).offset for name in Offsets._fields[1:]]
    except (AttributeError, ValueError) as error:
        raise LayoutError(
            f"mujoco {mujoco.__version__} lacks a field of mjData ({error}): install mujoco 3.17"
        ) from error
    if ctypes.c_int64.from_address(model._address + nuserdata).value != model.nuserdata:
        raise _mismatch("mjModel.nuserdata", nuserdata)
    for name, offset in zip(Offsets._fields[1:], arrays, strict=True):
        if ctypes.c_void_p.from_address(data._address + offset).value != getattr(data, name).ctypes.data:
            raise _mismatch(f"mjData.{name}", offset)
    return Offsets(nuserdata, *arrays)


def _mismatch(field: str, offset: int) -> LayoutError:
    return LayoutError(
        f"mujoco {mujoco.__version__}: {field} is not at byte {offset}, where introspection puts it; "
        "install mujoco 3.17"
    )
