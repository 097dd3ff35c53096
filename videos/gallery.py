"""The clips that README shows: four laws on each plant, a few seconds each, as animated WebP in videos/gallery.

make gallery          or          python videos/gallery.py
"""

from pathlib import Path

from rich.progress import track

import smc_mujoco as smc
from smc_mujoco.draw.video import clip

FOLDER = Path(__file__).parent / "gallery"
CLIPS = {  # name of the clip: plant, condition, title, seconds
    "inverted_pendulum": ("inverted_pendulum", "nominal", "Inverted pendulum", 1.5),
    "van_der_pol": ("van_der_pol", "noise", "Van der Pol under measurement noise", 4.0),
    "duffing": ("duffing", "nominal", "Duffing", 3.0),
    "pendulum_network": ("pendulum_network", "nominal", "Five coupled pendulums", 2.0),
}

for name, (plant, condition, title, seconds) in track(CLIPS.items(), "filming"):
    scenarios = smc.paper.comparison(plant, condition, duration=seconds)
    path = clip(smc.run(scenarios.values()), FOLDER / f"{name}.webp", title=title, span=(0.0, seconds))
    print(f"{path.relative_to(FOLDER.parents[1])}  {path.stat().st_size / 1e6:.2f} MB")
