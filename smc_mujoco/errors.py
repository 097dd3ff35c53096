"""The package's warnings. Its error, `ScenarioError`, is at the root."""

from smc_mujoco.common.errors import ScenarioWarning
from smc_mujoco.common.registry import PackageWarning
from smc_mujoco.control.component import GainWarning
from smc_mujoco.simulation.run import PlainLoopWarning

__all__ = ["GainWarning", "PackageWarning", "PlainLoopWarning", "ScenarioWarning"]
