"""Runs: from a scenario to a trace."""
