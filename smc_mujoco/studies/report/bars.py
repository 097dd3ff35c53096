"""What a report says on the terminal while it works: a bar a stage, with the time left, and a line when it is done."""

import contextlib
import time
from collections.abc import Callable, Iterator

from smc_mujoco.common import progress

Report = Callable[[float, float], None]  # told the work done and the whole


class Bars:
    """Bars on the terminal, or nothing. `spent`: stage -> s."""

    def __init__(self, shown: bool):
        self.shown = shown
        self.spent: dict[str, float] = {}

    @contextlib.contextmanager
    def stage(self, name: str, what: str = "", bar: bool = True) -> Iterator[Report]:
        """A stage of the work; `bar` says whether it has one of its own."""
        start = time.monotonic()
        with progress.bar(f"{name}  {what}", shown=bar and self.shown) as drawn:
            yield drawn.reached
        self.spent[name] = time.monotonic() - start
        if self.shown:
            print(f"{name:11} {what:16} {self.spent[name]:6.0f} s", flush=True)
