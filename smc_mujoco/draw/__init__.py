"""Pictures of traces: figures, films, the viewer, one style."""
