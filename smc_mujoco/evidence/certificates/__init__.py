"""Certificates: theorems about a law on a plant, with the data that prove them, and a separate
checker.
"""
