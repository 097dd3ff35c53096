"""Numba's private names, all that this package uses: a new version of numba may change any of them.

Of a library of compiled code it also uses `has_dynamic_globals`, `_final_module` and `codegen`, of
numba.np the kernel of functions of whole arrays, and `ensure_blas`, see jit.py.
"""

# ruff: noqa: F401
from numba.core import cgutils, ir
from numba.core.bytecode import FunctionIdentity
from numba.core.ccallback import CFunc
from numba.core.compiler import CompileResult, run_frontend
from numba.core.compiler_lock import global_compiler_lock
from numba.core.ir_utils import find_const, guard
from numba.core.serialize import dumps
from numba.core.typing.templates import builtin_registry
from numba.np import arrayobj

DYNAMIC_MODULE = "<dynamic>"  # stands for a module that cannot be imported
UNRESOLVED = ".numba.unresolved$"  # begins the name of what is filled in by the linker
