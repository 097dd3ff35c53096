"""Paper seeber_2024: claims in paper.toml, measured in claims.py."""
