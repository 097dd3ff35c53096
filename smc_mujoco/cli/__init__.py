"""The command line."""

from smc_mujoco.common.deprecated import old_names

__getattr__ = old_names(__name__, {"play": "smc_mujoco.cli.main"})
