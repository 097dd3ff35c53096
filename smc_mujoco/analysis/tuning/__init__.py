"""Gains by one rule for every law."""
