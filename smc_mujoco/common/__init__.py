"""Helpers for every room. They know nothing of control."""
