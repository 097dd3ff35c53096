"""How the claims of paper.toml are measured, a module for each part of the paper."""
