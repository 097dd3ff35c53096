"""Classes of immutable data, and their attributes by name."""

import dataclasses
from collections.abc import Iterable
from typing import Any, TypeVar, dataclass_transform

T = TypeVar("T")


@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field,))
def frozen_data(kind: type[T]) -> type[T]:
    """Make a class a frozen dataclass."""
    return dataclasses.dataclass(frozen=True)(kind)


@dataclass_transform(
    frozen_default=True, kw_only_default=True, field_specifiers=(dataclasses.field,)
)
def keyword_dataclass(kind: type[T]) -> type[T]:
    """Make a class a frozen dataclass whose fields are given by name."""
    return dataclasses.dataclass(frozen=True, kw_only=True)(kind)


def attributes(thing: object, names: Iterable[str]) -> dict[str, Any]:
    """Return name -> value of these attributes."""
    return {name: getattr(thing, name) for name in names}
