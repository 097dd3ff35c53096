"""The version of this package, and of those that its numbers depend on."""

__version__ = "0.1.0"


def versions() -> dict[str, str]:
    """Return package -> version, of those that the numbers of a search depend on."""
    from importlib.metadata import version

    others = "mujoco", "numba", "numpy", "scipy", "cmaes"
    return {"smc_mujoco": __version__} | {name: version(name) for name in others}
