"""What the tests share: this package's plugin, also where it is not installed, and pytest's for testing plugins."""

import importlib

import pytest

pytest_plugins = ["pytester"]


def pytest_addoption(parser: pytest.Parser, pluginmanager: pytest.PytestPluginManager) -> None:
    """Load the plugin, unless its entry point has: then, with its options, before they are read."""
    if not pluginmanager.hasplugin("smc_mujoco") and not pluginmanager.hasplugin("smc_mujoco.testing.plugin"):
        pluginmanager.register(importlib.import_module("smc_mujoco.testing.plugin"), "smc_mujoco")
