"""Decorators for classes of immutable data."""

import dataclasses
from typing import TypeVar, dataclass_transform

T = TypeVar("T")


@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field,))
def frozen_data(kind: type[T]) -> type[T]:
    """Make a class a frozen dataclass."""
    return dataclasses.dataclass(frozen=True)(kind)


@dataclass_transform(
    frozen_default=True, kw_only_default=True, field_specifiers=(dataclasses.field,)
)
def named_data(kind: type[T]) -> type[T]:
    """Make a class a frozen dataclass whose fields are given by name."""
    return dataclasses.dataclass(frozen=True, kw_only=True)(kind)
