"""Tuning of gains, by one rule for every law."""
