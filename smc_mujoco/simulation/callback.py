"""MuJoCo's control callback: one C function for every simulation of the process.

    with installed():
        batch.step(nstep=1000)

The callback is global to the process, so `installed` holds a lock, and restores the callback that
was there before. The callback acts only in this package's simulations, which it recognises by the
magic number in their userdata.

It reads and writes fields of mjModel and mjData at byte offsets. MuJoCo's introspection gives the C
type of every field of a struct, and the alignment rules of C give the offsets. `offsets` compares
each with a live MjData, so that a MuJoCo with another layout is refused instead of being read
wrongly.
"""

# pyright: reportCallIssue=false
# (an intrinsic is called without its typing context)
import contextlib
import ctypes
import functools
import warnings
from collections import namedtuple
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
from mujoco.introspect import ast_nodes, structs
from numba import njit, types

from smc_mujoco.common import fingerprint, mjcb
from smc_mujoco.common.errors import ScenarioError, ScenarioWarning, users_stacklevel
from smc_mujoco.common.jit import Key, compiled_cfunc, integers, pointer
from smc_mujoco.simulation.controller import Arrays
from smc_mujoco.simulation.controller import control as run_simulation
from smc_mujoco.simulation.model import USERDATA
from smc_mujoco.simulation.state import simulation_at

with mjcb.installed(
    None
):  # this import compiles a model; during a run it would wait for the run's end
    import mujoco.batch

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
WRONG_MUJOCO = "4.0.0"  # pyproject.toml excludes it
MAGIC = 7263.0  # the first number of this package's userdata: chosen
PROBE_MODEL = """<mujoco><size nuserdata="12345" nuser_actuator="1" nuser_body="1"/>
  <worldbody><body><joint name="j" frictionloss="1"/><geom size="1"/></body></worldbody>
  <tendon><fixed><joint joint="j" coef="1"/></fixed></tendon>
  <actuator><motor joint="j"/></actuator><sensor><jointpos joint="j"/></sensor></mujoco>"""

OF_MODEL = (
    "nuserdata",
    "dof_frictionloss",
    "actuator_user",
    "body_user",
)  # fields of mjModel; all others are of mjData
# Bytes from the start of mjModel or mjData to the fields. All but nuserdata are pointers.
Offsets = namedtuple("Offsets", ("nuserdata", "userdata", *Arrays._fields))


class LayoutError(ScenarioError):
    """The installed MuJoCo has a memory layout of mjModel or mjData that the callback does not
    know.
    """

    def __init__(self, problem: str):
        super().__init__(f"mujoco {mujoco.__version__} {problem}: install mujoco 3.17")


def _ctype(node: object) -> Any:
    """Return the ctypes equivalent of an introspected C type."""
    match node:
        case ast_nodes.PointerType():
            return ctypes.c_void_p
        case ast_nodes.ArrayType():
            return functools.reduce(
                lambda item, extent: item * extent, reversed(node.extents), _ctype(node.inner_type)
            )
        case ast_nodes.ValueType() if node.name in C_TYPES:
            return C_TYPES[node.name]
        case ast_nodes.ValueType() if node.name in structs.STRUCTS:
            return _ctype(structs.STRUCTS[node.name])
        case ast_nodes.ValueType() if node.name.startswith("mjt"):  # an enum
            return ctypes.c_int
        case ast_nodes.StructDecl() | ast_nodes.AnonymousStructDecl():
            fields = [(field.name, _ctype(field.type)) for field in node.fields]  # pyright: ignore[reportAttributeAccessIssue] unnamed unions are in no such struct
            return type("Struct", (ctypes.Structure,), {"_fields_": fields})
    raise LayoutError(f"has a field of unknown C type {node}")


def checked_offsets(model: mujoco.MjModel, data: mujoco.MjData) -> Offsets:
    """Return the introspected offsets, each compared with a live model and its data."""
    offsets = {}
    kinds = {struct: _ctype(structs.STRUCTS[struct]) for struct in ("mjModel", "mjData")}
    for name in Offsets._fields:
        if name in OF_MODEL:
            struct = "mjModel"
            live = model
        else:
            struct = "mjData"
            live = data
        if not (field := getattr(kinds[struct], name, None)):
            raise LayoutError(f"lacks the field {struct}.{name}")
        value = getattr(live, name)
        in_memory = ctypes.c_int64.from_address(live._address + field.offset).value
        if in_memory != (value.ctypes.data if isinstance(value, np.ndarray) else value):
            raise LayoutError(
                f"does not have {struct}.{name} at byte {field.offset}, where introspection puts it"
            )
        offsets[name] = field.offset
    return Offsets(**offsets)


@functools.cache
def offsets() -> Offsets:
    """Return the offsets, checked with a small model. Warn of a MuJoCo that computes wrongly."""
    if mujoco.__version__ == WRONG_MUJOCO:
        warnings.warn(
            f"MuJoCo {WRONG_MUJOCO} solves models of 60 coupled joints and more wrongly: install "
            "another version",
            ScenarioWarning,
            users_stacklevel(),
        )
    model = mujoco.MjModel.from_xml_string(PROBE_MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)  # which has the arrays of constraints
    return checked_offsets(model, data)


@njit(error_model="numpy", inline="always")
def array_at(address):
    """Follow the pointer at an address: return the numbers to which it points."""
    return pointer(integers(address)[0])


@functools.cache
def callback():
    """Return the compiled callback void(const mjModel*, mjData*), from numba's cache on disk if it
    is there.
    """
    offset = offsets()

    def control(model, data):
        if integers(model + offset.nuserdata)[0] < USERDATA:
            return
        userdata = array_at(data + offset.userdata)
        if userdata[0] != MAGIC:
            return
        address = int(userdata[1])
        arrays = Arrays(
            array_at(data + offset.qpos),
            array_at(data + offset.qvel),
            array_at(data + offset.ctrl),
            array_at(data + offset.xfrc_applied),
            array_at(data + offset.qfrc_applied),
            array_at(data + offset.sensordata),
            array_at(data + offset.xipos),
            array_at(data + offset.xanchor),
            array_at(data + offset.xaxis),
            array_at(data + offset.actuator_force),
            array_at(data + offset.qfrc_constraint),
            array_at(data + offset.qfrc_bias),
            array_at(data + offset.qfrc_spring),
            array_at(data + offset.qfrc_passive),
            array_at(data + offset.qfrc_actuator),
            array_at(data + offset.qLDiagInv),
            array_at(data + offset.efc_frictionloss),
            array_at(data + offset.efc_aref),
            array_at(data + offset.ten_J),
            array_at(model + offset.dof_frictionloss),
            integers(model + offset.actuator_user)[0],
            integers(model + offset.body_user)[0],
        )
        run_simulation(address, simulation_at(address, 0), arrays)

    key = Key("control", fingerprint.now(control))
    return compiled_cfunc(types.void(types.intp, types.intp), control, key)


@functools.cache
def silence():
    """Return a C function that ignores MuJoCo's warnings, which do not say which run they are
    about.
    """

    def silent(message):
        return

    signature = types.void(types.intp)
    return compiled_cfunc(signature, silent, Key("silent", ""))


@contextlib.contextmanager
def installed(control=None) -> Iterator[None]:
    """Install our control callback, or another one, for the length of a with block.

    Other threads wait.
    """
    with mjcb.installed(None):
        function = callback().ctypes if control is None else control
        silent = silence().ctypes
        before = mujoco.get_mju_user_warning()
        with mjcb.installed(function):
            try:
                mujoco.set_mju_user_warning(silent)
                yield
            finally:
                mujoco.set_mju_user_warning(before)
