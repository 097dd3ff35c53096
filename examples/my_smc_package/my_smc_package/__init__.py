"""A law, a plant, a scene and a paper for smc_mujoco, which finds them by the entry points in
pyproject.toml.
"""
