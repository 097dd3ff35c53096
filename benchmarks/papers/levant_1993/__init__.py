"""Paper levant_1993: claims in paper.toml, measured in claims.py."""
