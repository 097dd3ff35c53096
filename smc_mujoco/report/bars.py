"""What a report says on the terminal while it works: a bar a stage, with the time left, and a line when it is done."""

import contextlib
import time
from collections.abc import Callable, Iterator

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
        with self._bar(f"{name}  {what}") if bar and self.shown else contextlib.nullcontext(_silent) as report:
            yield report
        self.spent[name] = time.monotonic() - start
        if self.shown:
            print(f"{name:11} {what:16} {self.spent[name]:6.0f} s", flush=True)

    @contextlib.contextmanager
    def _bar(self, text: str) -> Iterator[Report]:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

        columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
        with Progress(*columns, transient=True, console=Console(stderr=True), speed_estimate_period=120) as progress:
            task = progress.add_task(text, total=None)
            yield lambda done, total: progress.update(task, completed=done, total=total)


def _silent(done: float, total: float) -> None:
    """Nothing to be seen."""
