"""Paper aldana_lopez_2019: claims in paper.toml, measured in claims.py."""
