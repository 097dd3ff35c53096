"""Chattering, predicted by harmonic balance. An annex: nothing in the core imports it."""
