"""Audits, real machines. An annex: nothing in the core imports it."""
