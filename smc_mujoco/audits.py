"""Audits of papers, laws and machines: claims, certificates, orders of accuracy, the whole study;
rigs, and parameters from their records.
"""

from smc_mujoco.common import lazy

_LAZY = lazy.lazy_module(__name__)
__getattr__ = _LAZY.getattr
__dir__ = _LAZY.dir
__all__ = list(_LAZY.origins)
