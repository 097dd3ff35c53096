"""Commands of the command line: plain functions that `cli.main` registers.

Importing them is cheap.
"""
