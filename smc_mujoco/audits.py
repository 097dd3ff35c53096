"""Audits of papers and of laws: claims, certificates, orders of accuracy, and the whole study."""

from smc_mujoco.common import lazy

_SHELF = lazy.shelf(__name__)
__getattr__ = _SHELF.getattr
__dir__ = _SHELF.dir
__all__ = list(_SHELF.origins)
