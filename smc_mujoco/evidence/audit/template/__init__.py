"""The folder that `smc-mujoco papers --new` copies: a paper with two claims, which runs as it is."""
