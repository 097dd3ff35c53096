"""From a trace to numbers."""

from smc_mujoco.common import lazy

_SHELF = lazy.shelf(__name__)
__getattr__, __dir__, __all__ = _SHELF.getattr, _SHELF.dir, [*_SHELF.origins, *_SHELF.modules]
