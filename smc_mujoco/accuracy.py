"""How accurate a law is as its period falls, and how far a run departs from itself at half the
step.
"""

from smc_mujoco.common import lazy

_LAZY = lazy.lazy_module(__name__)
__getattr__ = _LAZY.getattr
__dir__ = _LAZY.dir
__all__ = list(_LAZY.origins)
