"""Sliding surfaces, one per file; found by walking this package."""
