"""Paper seeber_2020: claims in paper.toml, measured in claims.py."""
