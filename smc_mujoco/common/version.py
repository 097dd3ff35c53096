"""The version of this package, and of those that its numbers depend on."""

import functools

__version__ = "0.1.0"


@functools.cache
def of(name: str) -> str:
    """Return the version of an installed package. Python reads it from a file, in 5 ms."""
    from importlib.metadata import version

    return version(name)


def versions() -> dict[str, str]:
    """Return package -> version, of those that the numbers of a search depend on."""
    packages = "mujoco", "numba", "numpy", "scipy", "cmaes"
    return {"smc_mujoco": __version__} | {name: of(name) for name in packages}
