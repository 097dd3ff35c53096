"""The clips that README shows: four laws on each plant, a few seconds each, as animated WebP in videos/gallery.

make gallery          or          python videos/gallery.py
"""

from pathlib import Path

from rich.progress import track

import smc_mujoco as smc
from smc_mujoco.draw.film.film import film

FOLDER = Path(__file__).parent / "gallery"
BLOW = {
    "contact": smc.Contact("stops", restitution=0.8),
    "friction": smc.Coulomb(0.05),
    "disturbance": smc.signals.Impulse(2.0, time=0.6, width=0.01),
}
CLIPS = {  # name of the clip: plant, condition, title, seconds, what else of the scenarios
    "inverted_pendulum": ("inverted_pendulum", "nominal", "Inverted pendulum", 1.5, {}),
    "van_der_pol": ("van_der_pol", "noise", "Van der Pol under measurement noise", 2.0, {}),
    "duffing": ("duffing", "nominal", "Duffing", 3.0, {}),
    "pendulum_network": ("pendulum_network", "nominal", "Five coupled pendulums", 2.0, {}),
    "hard_stops": ("inverted_pendulum", "nominal", "A blow, rubber stops, and friction in the joint", 2.2, BLOW),
}

for name, (plant, condition, title, seconds, changes) in track(CLIPS.items(), "filming"):
    scenarios = smc.paper.comparison(plant, condition, duration=seconds, changes=changes)
    path = film(smc.run(scenarios.values()), FOLDER / f"{name}.webp", title=title, span=(0.0, seconds))
    print(f"{path.relative_to(FOLDER.parents[1])}  {path.stat().st_size / 1e6:.2f} MB")
