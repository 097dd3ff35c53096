"""What a user's test can mend reaches it as one sentence, without the frames of this package."""

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from smc_mujoco.common.errors import ScenarioError

P = ParamSpec("P")
R = TypeVar("R")


def mendable(function: Callable[P, R]) -> Callable[P, R]:
    """The function, whose ScenarioErrors pytest shows where the test called it."""

    @functools.wraps(function)
    def call(*args: P.args, **named: P.kwargs) -> R:
        __tracebackhide__ = True
        try:
            return function(*args, **named)
        except ScenarioError as error:
            raise ScenarioError(str(error)) from None

    return call
