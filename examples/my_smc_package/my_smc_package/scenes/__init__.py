"""Scenes: one file for each question. `smc-mujoco run NAME` runs one."""
