"""Pictures of traces: figures, films, the viewer, one style."""

from pathlib import Path

__path__.append(str(Path(__file__).parents[1] / "moved" / "draw"))  # an old name, for one release
