"""Paper gaber: claims in paper.toml, measured in claims.py."""
