"""Laws from and to C and FMUs. An annex: nothing in the core imports it."""

from smc_mujoco.common import lazy

_SHELF = lazy.shelf(__name__)
__getattr__ = _SHELF.getattr
__dir__ = _SHELF.dir
__all__ = list(_SHELF.origins | _SHELF.modules)
