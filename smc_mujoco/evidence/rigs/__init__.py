"""Rigs: real machines with published or identified numbers, and their own controllers."""
