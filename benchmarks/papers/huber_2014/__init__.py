"""Paper huber_2014: claims in paper.toml, measured in claims.py."""
