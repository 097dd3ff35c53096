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
from smc_mujoco.draw.film.film import Frames, write

FOLDER = Path(__file__).parent / "gallery"


class Clip(NamedTuple):
    """What a clip shows: the paper's four laws with the study's gains, or `laws` with their
    published ones.
    """

    plant: str
    title: str
    seconds: float
    condition: str = "nominal"
    changes: Mapping[str, Any] = {}
    laws: Sequence[str] = ()

    def frames(self) -> Frames:
        """Return the pictures of the clip."""
        changes = dict(self.changes)
        runs = []
        for law in self.laws:
            runs.append(smc.Scenario(plant=self.plant, law=law, duration=self.seconds, **changes))
        if not self.laws:
            runs = smc.paper.comparison(
                self.plant, self.condition, duration=self.seconds, changes=changes
            ).values()
        return smc.film(smc.run(runs), title=self.title, fps=20.0)


BLOW = {
    "contact": smc.hardware.Contact("stops", restitution=0.8),
    "friction": smc.Coulomb(0.05),
    "disturbance": smc.signals.Impulse(2.0, time=0.6, width=0.01),
}
W = 2.0  # rad/s, of a figure of eight
EIGHT = {
    "reference": [
        smc.Sine(0.6, W),
        smc.Sine(0.3, 2.0 * W),
        smc.Constant(1.0),
        *[smc.Constant(0.0)] * 3,
    ],
    "x0": (0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
    "disturbance": smc.signals.Wind(x=5.0, time=1.5, width=1.0),
}
CLIPS = {  # name of the clip's file -> what it shows
    "inverted_pendulum": Clip("inverted_pendulum", "Inverted pendulum", 1.5),
    "van_der_pol": Clip("van_der_pol", "Van der Pol under measurement noise", 2.0, "noise"),
    "duffing": Clip("duffing", "Duffing", 3.0),
    "pendulum_network": Clip("pendulum_network", "Five coupled pendulums", 2.0),
    "hard_stops": Clip(
        "inverted_pendulum", "A blow, rubber stops, and friction in the joint", 2.2, changes=BLOW
    ),
    "quadrotor": Clip(
        "quadrotor",
        "A drone on a figure of eight, in a gust",
        3.2,
        changes=EIGHT,
        laws=("geometric", "quaternion_sliding"),
    ),
}

if __name__ == "__main__":
    for name, clip in CLIPS.items():
        path = write(clip.frames(), FOLDER / f"{name}.webp")
        print(f"{path.relative_to(FOLDER.parents[1])}  {path.stat().st_size / 1e6:.2f} MB")
