"""Runs of a plant's equation without MuJoCo, compiled for the processor or for a CUDA device.

A search, a map and a share of failures need thousands of runs of one law on one plant. So `loop`
writes the run of such a group out as one function: sensors, noise, estimator, law, delay,
disturbances and the plant's equation under RK4 in a single loop, compiled together with the law.
Scores are summed on the way. `group` tells what this engine cannot run; `cpu` and `gpu` compile it.
Plants without an equation run on a device in `worlds` that MuJoCo Warp steps; `choice` decides.

It finds gains, fills maps, and gives sensitivities and medians of worst-case searches; where its
numbers are shown, MuJoCo repeats CHECKED runs. All others are MuJoCo's.
"""

from typing import Annotated, Any

from smc_mujoco.common.constraints import OneOf
from smc_mujoco.common.data import keyword_dataclass

CHECKED = 20  # of its runs, which MuJoCo makes again where their numbers are shown; chosen
CONVERGES, UNDECIDED, DOES_NOT = 1, 0, -1  # outcomes of a run


@keyword_dataclass
class Available(OneOf):
    """One of some devices, of which this machine has the package and the hardware."""

    def __call__(self, what: str, value: Any) -> str:
        """Return the device, or raise ScenarioError. To check "cuda" it opens the GPU."""
        if super().__call__(what, value) == "cuda":
            from smc_mujoco.analysis.engine import gpu

            gpu.check_device()
        return value


Device = Annotated[str, Available(names=("cpu", "cuda"))]
