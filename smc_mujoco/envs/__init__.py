"""Plants as environments of agents."""

from importlib.util import find_spec

from smc_mujoco.common import lazy

_LAZY = lazy.lazy_module(__name__)
__getattr__ = _LAZY.getattr
__dir__ = _LAZY.dir
# so that a star import does without the packages that are missing
__all__ = ["agent"]
if find_spec("gymnasium"):
    __all__ += ["gym", "vector"]
if find_spec("dm_control"):
    __all__ += ["suite"]
