"""Paper acary_2012: claims in paper.toml, measured in claims.py."""
