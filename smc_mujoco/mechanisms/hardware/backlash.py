"""Backlash: play between a rotor, which the actuator drives, and the channel's joint. Its stops are
MuJoCo's limits.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, ClassVar

import mujoco

from smc_mujoco.common.constraints import Number
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.hardware.beside_joint import MIN_INERTIA, BesideJoint
from smc_mujoco.mechanisms.hardware.moments import Run
from smc_mujoco.mechanisms.hardware.part import HARD_SOLIMP, HARD_SOLREF, Natural, Offset
from smc_mujoco.mechanisms.layout import ROTOR
from smc_mujoco.mechanisms.plant import MAX_PARAMETER, Field, Plant

# Time constant, s, and damping ratio of the stops: with a ratio of 1 a flank rebounds at up to 25 %
# of its speed, according to where in its step it strikes, at any step; with 8 at up to 0.4 %. Steps
# of 0.125 ms let penetration fade.
STOP_SOLREF = (HARD_SOLREF[0], 8.0)
# s; tests/mechanisms/hardware/test_play.py compares with plastic stops
PLAY_STEP = 1.25e-4


@dataclasses.dataclass(frozen=True)
class Backlash(BesideJoint):
    """Play between a rotor, which the actuator drives, and the joint: |rotor - joint| <= gap/2.

    The stops of the play are MuJoCo's limits, as hard as it allows and damped so much that the
    flanks do not bounce: they rebound at less than 1 % of their speed. The default physics step is
    0.125 ms, as penetration fades slowly. The rotor starts in the middle of the play. With gap 0
    the rotor is rigid on the joint, and adds its inertia and damping to it.

    Attributes:
      gap: rad (m), the whole play; 0 or more.
      rotor_inertia: kg m^2 (kg) at the joint, 1e-9 or more; that of a DCMotor is added. The default
        is chosen: 1 % of the pendulums' 0.125.
      rotor_damping: N m s/rad (N s/m), 0 or more.
      lead, lead_rate: where in the play the rotor starts, rad (m) from its middle, and its rate.

    Raises:
      ScenarioError: a number out of its range, or a lead beyond the play.
    """

    smooth = False
    units: ClassVar[Mapping[str, str]] = {"gap": "{x}", **BesideJoint.units}
    # weight: of the little mass that the compiler needs; on a hinge it is on the axis
    names = "gap", "rotor_inertia", "rotor_damping", "weight"

    gap: Natural
    rotor_inertia: Annotated[float, Number(low=MIN_INERTIA, high=MAX_PARAMETER)] = 1e-3
    rotor_damping: Natural = 0.0
    lead: Offset = dataclasses.field(default=0.0, kw_only=True)
    lead_rate: Offset = dataclasses.field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if abs(self.lead) > 0.5 * self.gap:
            raise ScenarioError(
                f"Backlash's lead {self.lead:g} is beyond its play, {0.5 * self.gap:g} to each "
                "side: give one within it"
            )

    def longest_step(self, plant: Plant) -> float:
        return PLAY_STEP

    def numbers(self, run: Run) -> list[Sequence[float]]:
        model = run.model
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        rows = []
        for dof in run.dofs:
            joint = model.joint(ROTOR + model.joint(int(model.dof_jntid[dof])).name)
            rotor = joint.dofadr[0]
            weight = -data.qfrc_bias[rotor]
            rows.append((self.gap, model.dof_M0[rotor], self.rotor_damping, weight))
        return rows

    def couple(self, tendon: mujoco.MjsTendon) -> None:
        """Limit it to the play."""
        tendon.limited = True
        tendon.range = (-1.0, 1.0)
        tendon.solref_limit = STOP_SOLREF
        tendon.solimp_limit = HARD_SOLIMP

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        yield Field("tendon_range", self.tendons(model), (-self.gap / 2, self.gap / 2))
        yield from super().fields(model)
