"""A progress bar of a study: runs done, runs a second, time left."""

import contextlib
import time
from collections.abc import Iterator


class Counter:
    """Counts what is done; a bar may show it."""

    def __init__(self, runs: int, steps: int):
        self.total, self.all_steps = runs, steps
        self.runs = self.steps = 0
        self.start = time.monotonic()

    def stepped(self, steps: int) -> None:
        """Some more simulated steps."""
        self.steps += steps
        self.show()

    def finished(self, runs: int) -> None:
        """Some more runs, scored and written."""
        self.runs += runs
        self.show()

    def show(self) -> None:
        """Nothing, without a bar."""

    def __str__(self) -> str:
        spent = time.monotonic() - self.start
        rate = self.total * self.steps / self.all_steps / spent if self.all_steps and spent else 0.0
        return f"{self.runs} of {self.total} runs, {rate:.3g} a second"


@contextlib.contextmanager
def counter(runs: int, steps: int, shown: bool) -> Iterator[Counter]:
    """A Counter, with a bar on the terminal if that is wanted and there is something to do."""
    counts = Counter(runs, steps)
    if not (shown and runs):
        yield counts
        return
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
    with Progress(*columns, transient=True, speed_estimate_period=120) as bar:
        task = bar.add_task(str(counts), total=steps)
        counts.show = lambda: bar.update(task, completed=counts.steps, description=str(counts))
        yield counts
