"""Numba's private names, all that this package uses: a new version of numba may change any of them."""

# ruff: noqa: F401
from typing import Any

from numba import typeof
from numba.core import ir, registry
from numba.core.bytecode import FunctionIdentity
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.ccallback import CFunc
from numba.core.codegen import CPUCodeLibrary, RuntimeLinker
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher
from numba.core.errors import TypingError
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature
from numba.core.typing.templates import builtin_registry
from numba.core.utils import _dynamic_modname as dynamic_modname
from numba.core.utils import _dynamic_module as dynamic_module

cpu_target: Any = registry.cpu_target
