"""Audits, real machines, the report. An annex: nothing in the core imports it."""
