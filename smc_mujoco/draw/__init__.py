"""Pictures of traces: figures, films, live views, one style."""
