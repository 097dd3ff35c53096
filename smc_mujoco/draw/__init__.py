"""Pictures of traces: figures (figure, panels), films (video: stage, camera, arrows, charts, caption), one style."""
