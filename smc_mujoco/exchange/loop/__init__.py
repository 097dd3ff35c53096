"""Packages around an exported law: a controller of ros2_control, and a plain C loop."""
