"""The folder that `smc-mujoco claims --new` copies: a paper with two claims, which runs."""
