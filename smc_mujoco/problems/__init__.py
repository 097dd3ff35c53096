"""Annex: problems with names, suites of them, entries, results and their pages."""
