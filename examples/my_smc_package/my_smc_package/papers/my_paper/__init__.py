"""The paper of paper.toml."""
