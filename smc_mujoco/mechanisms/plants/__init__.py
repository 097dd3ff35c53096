"""One plant per file, beside its MJCF in models/; found by walking this package."""
