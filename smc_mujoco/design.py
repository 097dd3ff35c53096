"""Gains from theory, surfaces of your own, and what to expect of a law: a linearised plant,
chattering, a region of attraction, J for an optimiser of your own.
"""

from smc_mujoco.common import lazy

_LAZY = lazy.lazy_module(__name__)
__getattr__ = _LAZY.getattr
__dir__ = _LAZY.dir
__all__ = list(_LAZY.origins)
