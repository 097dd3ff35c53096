"""Laws from and to C and FMUs. An annex: nothing in the core imports it."""

from smc_mujoco.common import lazy

_LAZY = lazy.lazy_module(__name__)
__getattr__ = _LAZY.getattr
__dir__ = _LAZY.dir
__all__ = list(_LAZY.origins | _LAZY.modules)
