"""Velocity estimators, one per file; found by walking this package."""
