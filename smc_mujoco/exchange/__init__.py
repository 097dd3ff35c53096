"""Laws from and to C and FMUs, and the live page. An annex: nothing in the core imports it."""

from smc_mujoco.common import lazy

_SHELF = lazy.shelf(__name__)
__getattr__, __dir__, __all__ = _SHELF.getattr, _SHELF.dir, [*_SHELF.origins, *_SHELF.modules]
