"""The commands of the benchmark."""

from collections.abc import Callable

GROUPS: dict[str, list[Callable[..., None]]] = {}  # heading in the help -> commands
