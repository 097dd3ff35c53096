"""The clips that README and the pages show: laws side by side, a few seconds, as animated WebP in
videos/gallery.

make gallery          or          python videos/gallery.py

A test makes some of their pictures anew, so that a clip which the code would no longer make fails
it.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import smc_mujoco as smc
from smc_mujoco.control.law import Law
from smc_mujoco.draw.film.film import Frames, write_film
from smc_mujoco.mechanisms.plant import Plant

FOLDER = Path(__file__).parent / "gallery"


class Clip(NamedTuple):
    """What a clip shows: laws of the paper, all four unless `laws_shown` names some, with the
    study's gains, or `laws` with their published ones.
    """

    plant: str | Plant
    title: str
    seconds: float
    condition: str = "nominal"
    changes: Mapping[str, Any] = {}
    laws: Sequence[str | Law] = ()
    laws_shown: Sequence[str] = smc.paper.LAWS

    def frames(self, **options: Any) -> Frames:
        """Return the pictures of the clip; options as of `smc.film`."""
        changes = dict(self.changes)
        runs = []
        for law in self.laws:
            runs.append(smc.Scenario(plant=self.plant, law=law, duration=self.seconds, **changes))
        if not self.laws:
            compared = smc.paper.comparison(
                str(self.plant), self.condition, duration=self.seconds, changes=changes
            )
            runs = [compared[law] for law in self.laws_shown]
        return smc.film(smc.run(runs), title=self.title, fps=20.0, **options)


BLOW = {
    "contact": smc.hardware.Contact("stops", restitution=0.8),
    "friction": smc.Coulomb(0.05),
    "disturbance": smc.signals.Impulse(2.0, time=0.6, width=0.01),
}
TWO = "observer_free", "adaptive"  # whose machines are larger than those of four
W = 2.0  # rad/s, of a figure of eight
EIGHT = {
    "reference": [
        smc.Sine(0.6, W),
        smc.Sine(0.3, 2.0 * W),
        smc.Constant(1.0),
        *[smc.Constant(0.0)] * 3,
    ],
    "x0": (0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
    "v0": (0.6 * W, 0.6 * W, 0.0, 0.0, 0.0, 0.0),
    "disturbance": smc.signals.Wind(x=6.0, time=1.5, width=1.0),
}
ARM = """
<mujoco model="arm">
  <default><geom type="capsule" size="0.03" contype="0" conaffinity="0"/></default>
  <worldbody>
    <geom name="stand" type="cylinder" size="0.05" fromto="0 0 0 0 0 0.55" rgba="0.3 0.33 0.36 1"/>
    <body name="upper" pos="0 0 0.6">
      <joint name="shoulder" axis="0 1 0" damping="0.2"/>
      <geom fromto="0 0 0 0.4 0 0" mass="1"/>
      <body name="fore" pos="0.4 0 0">
        <joint name="elbow" axis="0 1 0" damping="0.1"/>
        <geom fromto="0 0 0 0.35 0 0" mass="0.6"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="shoulder" ctrlrange="-30 30"/><motor joint="elbow" ctrlrange="-15 15"/>
  </actuator>
</mujoco>
"""
# It goes down to 2 cm above the wall, where a ball falls on it.
STRANGER = {
    "reference": [smc.Constant(0.05), smc.Constant(0.0)],
    "contact": (
        smc.Wall("fore", direction=(0, 0, -1), gap=0.175),
        smc.Ball("fore", mass=0.5, height=0.05),
    ),
}
CLIPS = {  # name of the clip's file -> what it shows
    "inverted_pendulum": Clip("inverted_pendulum", "Inverted pendulum", 1.5),
    "van_der_pol": Clip("van_der_pol", "Van der Pol, noise", 2.0, "noise", laws_shown=TWO),
    "duffing": Clip("duffing", "Duffing", 3.0, laws_shown=TWO),
    "pendulum_network": Clip("pendulum_network", "Coupled pendulums", 2.0, laws_shown=TWO),
    "hard_stops": Clip(
        "inverted_pendulum",
        "Blow, rubber stops, friction",
        2.2,
        changes=BLOW,
        laws_shown=("classical", "adaptive", "super_twisting"),
    ),
    "wall_and_ball": Clip(
        smc.plant_from(
            ARM, channels={"shoulder": smc.Channel(x0=-0.3), "elbow": smc.Channel(x0=0.1)}
        ),
        "Your robot, a wall, a ball",
        2.0,
        changes=STRANGER,
        laws=(
            smc.law("pid", kp=(150.0, 60.0), kd=(15.0, 5.0), ki=(50.0, 20.0)),
            smc.law("super_twisting"),
        ),
    ),
    "quadrotor": Clip(
        "quadrotor",
        "A drone in a gust",
        3.2,
        changes=EIGHT,
        laws=("geometric", "adaptive_quaternion_sliding"),
    ),
}

if __name__ == "__main__":
    for name, clip in CLIPS.items():
        path = write_film(clip.frames(), FOLDER / f"{name}.webp")
        print(f"{path.relative_to(FOLDER.parents[1])}  {path.stat().st_size / 1e6:.2f} MB")
