"""Plants from a user's own MJCF."""
