"""Pictures of traces: figures (figure, panels), films (video: stage, camera, arrows, charts, caption), one style."""

from pathlib import Path

__path__.append(str(Path(__file__).parents[1] / "moved" / "draw"))  # an old name, for one release
