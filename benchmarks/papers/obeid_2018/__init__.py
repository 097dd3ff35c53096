"""Paper obeid_2018: claims in paper.toml, measured in claims.py."""
