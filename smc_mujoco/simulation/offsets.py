"""Byte offsets of the mjModel and mjData fields that the callback reads and writes.

MuJoCo's introspection gives the C type of every field of a struct, and the alignment rules of C give the offsets.
`offsets` compares each offset with a live MjData before the callback uses it, so that a MuJoCo with another layout is
refused instead of being read wrongly.
"""

import ctypes
import functools
from collections import namedtuple
from typing import Any

import mujoco
from mujoco.introspect import ast_nodes, structs

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.simulation.controller import Arrays

C_TYPES = {
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
PROBE_MODEL = """<mujoco><size nuserdata="12345"/><worldbody><body><joint name="j"/><geom size="1"/></body></worldbody>
  <actuator><motor joint="j"/></actuator><sensor><jointpos joint="j"/></sensor></mujoco>"""


class LayoutError(ScenarioError):
    """The installed MuJoCo has a memory layout of mjModel or mjData that the callback does not know."""

    def __init__(self, problem: str):
        super().__init__(f"mujoco {mujoco.__version__} {problem}: install mujoco 3.17")


# Bytes from the start of mjModel to nuserdata, and from the start of mjData to the other fields, all pointers.
Offsets = namedtuple("Offsets", ("nuserdata", "userdata", *Arrays._fields))


def _ctype(node: object) -> Any:
    """Return the ctypes equivalent of an introspected C type."""
    match node:
        case ast_nodes.PointerType():
            return ctypes.c_void_p
        case ast_nodes.ArrayType():
            return functools.reduce(lambda item, extent: item * extent, reversed(node.extents), _ctype(node.inner_type))
        case ast_nodes.ValueType() if node.name in C_TYPES:
            return C_TYPES[node.name]
        case ast_nodes.ValueType() if node.name in structs.STRUCTS:
            return _ctype(structs.STRUCTS[node.name])
        case ast_nodes.ValueType() if node.name.startswith("mjt"):  # an enum
            return ctypes.c_int
        case ast_nodes.StructDecl() | ast_nodes.AnonymousStructDecl():
            fields = [(field.name, _ctype(field.type)) for field in node.fields]
            return type("Struct", (ctypes.Structure,), {"_fields_": fields})
    raise LayoutError(f"has a field of unknown C type {node}")


@functools.cache
def offsets() -> Offsets:
    """Return the offsets, checked with a small model."""
    model = mujoco.MjModel.from_xml_string(PROBE_MODEL)
    return checked_offsets(model, mujoco.MjData(model))


def checked_offsets(model: mujoco.MjModel, data: mujoco.MjData) -> Offsets:
    """Return the introspected offsets, each compared with a live model and its data."""
    offsets = {}
    for struct, names, live in (("mjModel", Offsets._fields[:1], model), ("mjData", Offsets._fields[1:], data)):
        kind = _ctype(structs.STRUCTS[struct])
        for name in names:
            if not (field := getattr(kind, name, None)):
                raise LayoutError(f"lacks the field {struct}.{name}")
            value = getattr(live, name)
            in_memory = ctypes.c_int64.from_address(live._address + field.offset).value
            if in_memory != (value if live is model else value.ctypes.data):
                raise LayoutError(f"does not have {struct}.{name} at byte {field.offset}, where introspection puts it")
            offsets[name] = field.offset
    return Offsets(**offsets)
