"""Paper levant_2003: claims in paper.toml, measured in claims.py."""
