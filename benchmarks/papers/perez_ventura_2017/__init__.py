"""Paper perez_ventura_2017: claims in paper.toml, measured in claims.py."""
