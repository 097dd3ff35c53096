"""Sliding surfaces, one per file. Every module of this package is searched for surfaces. Notation
as in laws.
"""
