"""A user's own machine as a rig: how it repeats logs is in log_rig.py; here is what identification
asks of it.
"""

import math
import shlex
from collections.abc import Sequence
from pathlib import Path

from smc_mujoco.common.aliases import AnyPath, Array, Data, Fields, Numbers
from smc_mujoco.common.data import keyword_dataclass
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.text import joined
from smc_mujoco.identification import first_guess, log_quality, model_file, servo_columns
from smc_mujoco.identification.compliance import compliance
from smc_mujoco.identification.lack_of_fit import Lack
from smc_mujoco.identification.lacking_forces import lacking_forces
from smc_mujoco.identification.log_rig import LogRig, of_runs
from smc_mujoco.identification.paths import known_paths, resolved, usual_paths, with_plays
from smc_mujoco.identification.presliding import presliding
from smc_mujoco.identification.records import Columns, Record
from smc_mujoco.identification.replays import Replays, Slopes
from smc_mujoco.identification.rig import Values
from smc_mujoco.mechanisms.layout import column_ends, dof_ids
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.part_numbers import parts_of
from smc_mujoco.simulation.scenario import Scenario


@keyword_dataclass
class OwnRig(LogRig):
    """A user's own machine."""

    def guessed(self, data: Sequence[Data]) -> LogRig:
        """Return the rig with values from least squares of the forces of its logs."""
        return first_guess.first_guess(self, data)

    def check_named(self, line: Sequence[str]) -> None:
        """Raise ScenarioError if no number is named. It lists what there is, and ends with the
        words of a shell's `line` that names some, or without a line with such names.
        """
        if self.free:
            return
        names = usual_paths(self.base)
        cure = f"give names={names!r}"
        if line:
            cure = f"write {shlex.join([*line, '--for', ','.join(names)])}"
        paths = ", ".join(known_paths(self.base))
        raise ScenarioError(f"no number of {self.name} is named. There are {paths}: {cure}")

    def doubts(self, data: Sequence[Data]) -> list[str]:
        """Return sentences on what may be wrong with columns of logs."""
        doubts = first_guess.doubts(self, data) + servo_columns.doubts(self, data)
        return doubts + log_quality.doubts(self, data)

    def unseen(self, name: str) -> str:
        """Return a sentence on why a log does not show a number, and what to do; "" if only the log
        is known to lack it. A servo's stiffness shows where it moves a mass, or holds a weight.
        """
        place = self.places.get(name)
        if place is None or place.name != "kp":
            return ""
        servo = parts_of(self.base, place.field)[place.part]
        i = servo.channels(self.plant)[0]
        model = self.plant.load()
        rate = math.sqrt(servo.kp / model.dof_M0[dof_ids(model)[i]])
        return (
            f"the log does not show {name}: its joint follows the set-point slowly, or rests, and "
            "then only friction over kp shows; record motion that is nearer to "
            f"{rate:.2g} rad/s, at which the joint swings on its "
            "servo, or let it hold a known weight"
        )

    def lacks(self, replays: Replays, slopes: Slopes) -> list[Lack]:
        """Return what the model may lack: forces of many shapes, dry friction that gives way, and
        a spring before a joint.
        """
        solved = self.with_values(replays.values(slopes.point))
        lacks = lacking_forces(solved, replays, slopes) + presliding(solved, replays, slopes)
        return lacks + compliance(solved, replays, slopes)

    def save_model(self, path: Path) -> Path:
        """Write the machine's model file with the rig's values, and return the path."""
        return model_file.save_model(self, path)

    def figure(
        self,
        covariance: Array,
        record: Data,
        prediction: tuple[Record, Record, Array],
        fit: Numbers,
        path: AnyPath,
    ) -> list[Path]:
        """Draw the log, its prediction, and the friction of each joint."""
        from smc_mujoco.identification.friction_figure import friction_figure

        return friction_figure(self, covariance, self.checked(record), prediction, fit, path)


def own_rig(given: Plant | Scenario, names: Sequence[str]) -> OwnRig:
    """Return the rig of a plant or a scenario whose quantities are the named paths."""
    base = given if isinstance(given, Scenario) else Scenario.recorded(plant=given, law="none")
    if unused := [name for name in base.mismatch if name not in names]:
        raise ScenarioError(
            f"identify has the numbers of the model's file, and no mismatch of {joined(unused)}: "
            "name them among the numbers to find, or write them into the file"
        )
    base = with_plays(base, names)
    paths = resolved(base, names)
    ends = column_ends(base.plant)
    inputs = tuple(f"u{end}" for end in ends[: base.plant.driven])

    def machine(values: Values) -> Fields:
        return of_runs(rig, values)

    rig = OwnRig(
        name=base.plant.name,
        label=base.plant.label or base.plant.name,
        quantities=paths.quantities,
        machine=machine,
        columns=Columns(
            x=tuple(f"x{end}" for end in ends), u=inputs[0], reference=f"r{ends[0]}", inputs=inputs
        ),
        free=tuple(names),
        base=base,
        plant=paths.plant,
        places=paths.parts,
    )
    return rig
