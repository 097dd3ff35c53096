"""Papers as data, a folder for each: its claims in paper.toml, and how they are measured in
claims.py.
"""
