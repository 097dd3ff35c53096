"""Progress of work that takes more than two seconds: a bar on a terminal and in a notebook, lines in a log."""

import contextlib
import html
import math
import sys
import time
from collections.abc import Callable, Iterator

from smc_mujoco.common.html import in_notebook

Report = Callable[[float, float], None]  # called with the work done and the whole work, which may be an estimate
SPEED_WINDOW = 120.0  # s over which the terminal's bar averages its speed, for the time left: chosen
DRAWING_PERIOD, LINE_PERIOD = 0.2, 10.0  # s between two drawings of a notebook's bar, and two lines of a log: chosen


class Bar:
    """A progress bar that draws nothing. `bar` yields one that draws."""

    def advance(self, work: float) -> None:
        """Add work that is done."""

    def reached(self, done: float, whole: float) -> None:
        """Set the work done and the whole work, which may change from call to call."""

    def says(self, text: str, work: float = 0.0) -> None:
        """Change the text beside the bar, and add work that is done."""


@contextlib.contextmanager
def bar(what: str, whole: float | None = None, shown: bool = True, counted: bool = False) -> Iterator[Bar]:
    """Show a bar while the block lasts. If stderr is no terminal, print a line each ten seconds instead."""
    if not shown:
        yield Bar()
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True)
    if in_notebook():
        with contextlib.closing(NotebookBar(what, whole, counted)) as cell:
            yield cell
        return
    if not console.is_terminal:
        yield LogBar(what, whole, counted)
        return
    share = MofNCompleteColumn() if counted else TaskProgressColumn()
    columns = TextColumn("{task.description}", markup=False), BarColumn(), share, TimeRemainingColumn()
    with Progress(*columns, transient=True, console=console, speed_estimate_period=SPEED_WINDOW) as progress:
        task, drawn = progress.add_task(what, total=whole), Bar()
        drawn.advance = lambda work: progress.advance(task, work)
        drawn.reached = lambda done, whole: progress.update(task, completed=done, total=whole)
        drawn.says = lambda text, work=0.0: progress.update(task, description=text, advance=work)
        yield drawn


class LogBar(Bar):
    """A bar as lines on stderr, the first after LINE_PERIOD."""

    period = LINE_PERIOD

    def __init__(self, what: str, whole: float | None, counted: bool):
        self.what, self.whole, self.counted = what, whole, counted
        self.done, self.start = 0.0, time.monotonic()
        self.drawn = self.start

    def advance(self, work: float) -> None:
        """Add work that is done."""
        self.reached(self.done + work, self.whole or 0.0)

    def reached(self, done: float, whole: float) -> None:
        """Set the work done and the whole."""
        self.done, self.whole = done, whole
        self._draw()

    def says(self, text: str, work: float = 0.0) -> None:
        """Change the text beside the bar, and add work that is done."""
        self.what = text
        self.advance(work)

    def _draw(self) -> None:
        """Show the bar as it is, unless it was shown less than a period ago."""
        now = time.monotonic()
        if now - self.drawn >= self.period:
            self.drawn = now
            self.show()

    def show(self) -> None:
        """Print a line."""
        print(self, file=sys.stderr)

    @property
    def share(self) -> float:
        """The share of the work that is done."""
        return min(1.0, self.done / self.whole) if self.whole else 0.0

    def __str__(self) -> str:
        if not self.whole:
            return self.what
        size = f"{self.done:g}/{self.whole:g}" if self.counted else f"{100 * self.share:.0f} %"
        left = (time.monotonic() - self.start) * (1.0 / self.share - 1.0) if self.share else math.inf
        return f"{self.what} {size}" + (f", {left:.0f} s left" if left < math.inf else "")


class NotebookBar(LogBar):
    """A bar in a notebook's cell, which vanishes in the end. It is HTML, because rich warns without ipywidgets."""

    period = DRAWING_PERIOD

    def __init__(self, what: str, whole: float | None, counted: bool):
        from IPython.display import HTML, display

        super().__init__(what, whole, counted)
        self.drawn, self.html = -math.inf, HTML
        self.cell = display(HTML(""), display_id=True)

    def close(self) -> None:
        """Take the bar away."""
        if self.cell is not None:
            self.cell.update(self.html(""))

    def show(self) -> None:
        """Draw the bar."""
        if self.cell is not None:
            value = f' value="{self.share:.3f}" max="1"' if self.whole else ""
            self.cell.update(self.html(f"<progress{value}></progress> {html.escape(str(self))}"))


def summed(report: Report, done: float, whole: float) -> Callable[[float], None]:
    """Return a function that reports the work done so far, increased by a piece of work in each call."""

    def add(work: float) -> None:
        nonlocal done
        done += work
        report(done, whole)

    return add


class Counter:
    """Count of a study's simulated steps. Its text, shown beside a bar, has the runs done and the runs a second."""

    def __init__(self, runs: int, steps: int, bar: Bar):
        self.total, self.all_steps, self.bar = runs, steps, bar
        self.steps = 0
        self.start = time.monotonic()

    def stepped(self, steps: int) -> None:
        """Add simulated steps."""
        self.steps += steps
        self.bar.says(str(self), steps)

    def __str__(self) -> str:
        spent = time.monotonic() - self.start
        runs = self.total * self.steps / self.all_steps if self.all_steps else 0.0
        return f"{math.floor(runs + 1e-9)} of {self.total} runs, {runs / spent if spent else 0.0:.3g} a second"


@contextlib.contextmanager
def counter(runs: int, steps: int, shown: bool) -> Iterator[Counter]:
    """Yield a Counter, with a bar on the terminal if `shown` and if there is something to do."""
    with bar("", steps, shown=shown and runs > 0) as drawn:
        counts = Counter(runs, steps, drawn)
        drawn.says(str(counts))
        yield counts
