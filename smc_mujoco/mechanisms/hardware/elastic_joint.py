"""An elastic joint: a spring and a damper between the joint and a rotor, which the actuator drives.

    rotor_inertia w' = motor - rotor_damping w - f           y' = w: the rotor
    f = stiffness (y - x) + damping (y' - x')                f acts on the joint, x

Source: M. W. Spong, Modeling and control of elastic joint robots, ASME Journal of Dynamic Systems,
Measurement, and Control 109(4), 1987, with a damper beside the spring.
"""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar

import mujoco
import numpy as np

from smc_mujoco.common.constraints import Number
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.mechanisms.hardware.beside_joint import MIN_INERTIA, BesideJoint
from smc_mujoco.mechanisms.hardware.moments import Run
from smc_mujoco.mechanisms.hardware.part import Actuator, Natural, Offset, Positive
from smc_mujoco.mechanisms.layout import dof_ids, loaded
from smc_mujoco.mechanisms.plant import MAX_PARAMETER, Field, Plant

# of a step times the fastest pole: of the default step, at which an undamped rotor that swings by
# 5 rad is within 1e-6 rad of its place after a second; and of any step
FINE_POLE = 0.05
MAX_POLE = 0.7
SHORTEST_STEP = 1e-5  # s, of the default; chosen: a run of 10 s is a million steps


@dataclasses.dataclass(frozen=True)
class ElasticJoint(BesideJoint):
    """A spring between a rotor, which the actuator drives, and the joint, as in a harmonic drive.

        arm = smc.hardware.ElasticJoint(stiffness=1e4, damping=5.0, rotor_inertia=0.2)
        smc.Scenario(plant="inverted_pendulum", law="pid", actuator=arm)

    x is the joint's position, behind the spring; so are v, errors and scores. The law reads the
    joint too, or the rotor through an `Encoder(side="motor")`. The law's model does not know the
    spring. The rotor starts beside the joint, at rest against it, with the spring unbent, unless
    `lead` and `lead_rate` say otherwise.

    The default physics step follows the fastest oscillation, to 0.01 ms. A stiffness for which
    that is too long is refused, as is a `physics_step` of your own that does not resolve it.

    Attributes:
      stiffness: N m/rad (N/m) at the joint, greater than 0. Harmonic drives of robot arms have 1e3
        to 5e4 N m/rad.
      damping: N m s/rad (N s/m) of the speed between rotor and joint, 0 or more.
      rotor_inertia: kg m^2 (kg) at the joint, which is gear^2 times that at the motor; 1e-9 or
        more; that of a DCMotor is added. The default is chosen: 1 % of the pendulums' 0.125.
      rotor_damping: N m s/rad (N s/m) of the rotor's bearings, 0 or more.
      lead, lead_rate: by which the spring is bent at the start of a run, rad (m), and its rate.
    """

    units: ClassVar[Mapping[str, str]] = {
        "stiffness": "{f}/{x}",
        "damping": "{f} s/{x}",
        **BesideJoint.units,
    }
    names = "stiffness", "damping", "rotor_inertia", "rotor_damping"

    stiffness: Positive
    damping: Natural = 0.0
    rotor_inertia: Annotated[float, Number(low=MIN_INERTIA, high=MAX_PARAMETER)] = 1e-3
    rotor_damping: Natural = 0.0
    lead: Offset = dataclasses.field(default=0.0, kw_only=True)
    lead_rate: Offset = dataclasses.field(default=0.0, kw_only=True)

    def fastest_pole(self, plant: Plant) -> float:
        """Return the largest |pole| of rotor and joint, 1/s, where the model has all joints at 0
        and the other joints are free.
        """
        model = loaded(plant)
        dofs = dof_ids(model)[[*self.channels(plant)]]
        mobility = 1.0 / self.rotor_inertia + model.dof_invweight0[dofs].max()
        drag = self.damping * mobility + self.rotor_damping / self.rotor_inertia
        roots = np.roots([1.0, drag, self.stiffness * mobility])
        return float(np.abs(roots).max())

    def longest_step(self, plant: Plant) -> float:
        return max(FINE_POLE / self.fastest_pole(plant), SHORTEST_STEP)

    def suits(self, s: Any, chain: Sequence[Actuator]) -> None:
        pole = self.fastest_pole(s.plant)
        if s.physics_step * pole > MAX_POLE:
            joint = self.joint_names(s.plant)[0]
            steps = math.ceil(s.control_period * pole / MAX_POLE)
            raise ScenarioError(
                f"ElasticJoint of stiffness {self.stiffness:g} on joint {joint!r} of "
                f"{s.plant.name} has a pole at {pole:.3g} 1/s, which a physics step of "
                f"{s.physics_step:g} s does not resolve: give "
                f"physics_step={s.control_period:g}/{steps} or less, a heavier rotor, or leave it "
                "out, as so stiff a joint is nearly rigid"
            )

    def numbers(self, run: Run) -> list[Sequence[float]]:
        return [[getattr(self, name) for name in self.names]] * run.n

    def couple(self, tendon: mujoco.MjsTendon) -> None:
        """Make a spring of it, unbent where rotor and joint are at the same angle."""
        tendon.springlength = (0.0, 0.0)

    def fields(self, model: mujoco.MjModel) -> Iterator[Field]:
        springs = self.tendons(model)
        yield Field("tendon_stiffness", springs, self.stiffness)
        yield Field("tendon_damping", springs, self.damping)
        yield from super().fields(model)
        bodies = model.dof_bodyid[self.rotors(model)]
        yield Field("body_mass", bodies, 0.0)  # of which the compiler needs some
        yield Field("body_inertia", bodies, 0.0)
