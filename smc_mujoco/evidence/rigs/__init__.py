"""Rigs: real machines with published or identified numbers, their records, and identification from
records.
"""
