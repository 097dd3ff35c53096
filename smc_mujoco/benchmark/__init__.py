"""Annex: problems with names, suites of them, entries, results and their pages; and RealAIGym's
boards.
"""
