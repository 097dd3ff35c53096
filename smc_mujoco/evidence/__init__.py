"""Audits of papers, published boards, real machines, and the report. An annex: nothing in the core imports it."""
