"""From a trace to numbers."""

from smc_mujoco.common.deprecated import old_names

__getattr__ = old_names(__name__, dict.fromkeys(("score", "scores"), "smc_mujoco.metrics.catalogue"))
