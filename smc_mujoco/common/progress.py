"""Progress of work that takes more than two seconds: a bar on a terminal, a line that vanishes in a
notebook, lines elsewhere.
"""

import contextlib
import math
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from smc_mujoco.common.aliases import ProgressTo

if TYPE_CHECKING:
    from rich.console import Console

# called with the work done and the whole work, which may be an estimate
Report = Callable[[float, float], None]
MIN_PIECE = 0.1  # s; a piece of work that took less was read from a file: it tells no speed
MIN_SHARE = 0.1  # of the work, before which no time is estimated; chosen
LINE_PERIOD = 10.0  # s between two lines of a log


class Bar:
    """Work that is done, shown by `draw` at most once in a period (s), first after a delay (s)."""

    def __init__(
        self,
        what: str = "",
        whole: float | None = None,
        counted: bool = False,
        draw: "Callable[[Bar], object] | None" = None,
        period: float = 0.0,
        delay: float = 0.0,
    ):
        self.what = what
        self.whole = whole
        self.counted = counted
        self.draw = draw
        self.period = period
        self.done = 0.0
        self.pieces: list[float] = []  # s that each finished piece took
        self.end: float | None = None  # s, when the last piece is expected to end
        self.latest = math.inf  # s, when the work is stopped
        self.start = time.monotonic()
        self.due = self.start + delay  # s, of the next drawing

    def advance(self, work: float) -> None:
        """Add work that is done."""
        self.reached(self.done + work, self.whole)

    def reached(self, done: float, whole: float | None) -> None:
        """Set the work done and the whole work, which may change from call to call."""
        self.done = done
        self.whole = whole
        if self.draw is not None and (now := time.monotonic()) >= self.due:
            self.due = now + self.period
            self.draw(self)

    def says(self, text: str, work: float = 0.0) -> None:
        """Change the text beside the bar, and add work that is done."""
        self.what = text
        self.advance(work)

    def add_piece(self, seconds: float, left: int) -> None:
        """Record how long a piece of the work took, s, and how many are left, each of which is
        expected to take the median.
        """
        if seconds > MIN_PIECE:
            self.pieces.append(seconds)
        if self.pieces:
            self.end = time.monotonic() + left * statistics.median(self.pieces)

    @property
    def share(self) -> float:
        """The share of the work that is done."""
        if self.whole:
            return min(1.0, self.done / self.whole)
        return 0.0

    @property
    def left(self) -> str:
        """The time that is left in words, such as "12 s left"; "" before a share of MIN_SHARE is
        done, as first estimates were 10 to 30 times too long.
        """
        now = time.monotonic()
        if self.whole and self.share < MIN_SHARE:
            return ""
        if self.end is not None:
            seconds = max(0.0, self.end - now)
        elif self.share:
            seconds = (now - self.start) * (1.0 / self.share - 1.0)
        else:
            return ""
        return f"{length(min(seconds, max(0.0, self.latest - now)))} left"

    def __str__(self) -> str:
        if not self.whole:
            return self.what
        text = f"{self.what}, {100 * self.share:.0f} %"
        if self.counted:
            text = f"{self.what} {self.done:g}/{self.whole:g}"
        return ", ".join(filter(None, (text, self.left)))


def length(seconds: float) -> str:
    """Return a time in words, such as "12 s" or "3 min"."""
    if seconds > 90.0:
        return f"{math.ceil(seconds / 60.0)} min"
    return f"{seconds:.0f} s"


@contextlib.contextmanager
def bar(
    what: str, whole: float | None = None, shown: ProgressTo = True, counted: bool = False
) -> Iterator[Bar]:
    """Show a bar while the block lasts, or tell the function `shown` of each step.

    If stderr is no terminal, print a line each ten seconds instead; in a notebook the next replaces
    it, and nothing of it stays.

    `whole` is None if `reached` sets it; if `counted`, the bar has "3/60" instead of a percentage.
    """
    if not shown:
        yield Bar()
        return
    if callable(shown):
        tell = shown
        yield Bar(what, whole, counted, lambda bar: tell(bar.what, bar.share))
        return
    from rich.console import Console

    console = Console(stderr=True)
    if console.is_jupyter:
        with _in_notebook() as draw:
            yield Bar(what, whole, counted, draw, LINE_PERIOD, LINE_PERIOD)
    elif console.is_terminal:
        with _on_terminal(what, whole, counted, console) as draw:
            yield Bar(what, whole, counted, draw)
    else:
        yield Bar(
            what,
            whole,
            counted,
            lambda bar: print(bar, file=sys.stderr),
            LINE_PERIOD,
            LINE_PERIOD,
        )


@contextlib.contextmanager
def _on_terminal(
    what: str, whole: float | None, counted: bool, console: "Console"
) -> Iterator[Callable[[Bar], None]]:
    """Yield what draws a bar with rich."""
    from rich import progress

    share = progress.MofNCompleteColumn() if counted else progress.TaskProgressColumn()
    text = progress.TextColumn("{task.description}", markup=False)
    columns = text, progress.BarColumn(), share, progress.TextColumn("{task.fields[left]}")
    with progress.Progress(*columns, transient=True, console=console) as drawn:
        task = drawn.add_task(what, total=whole, left="")
        yield lambda bar: drawn.update(
            task, completed=bar.done, total=bar.whole, description=bar.what, left=bar.left
        )


@contextlib.contextmanager
def _in_notebook() -> Iterator[Callable[[Bar], None]]:
    """Yield what draws a bar in an output of the cell, which is left empty."""
    from IPython.display import DisplayHandle

    output = DisplayHandle()
    displayed = False

    def draw(bar: object) -> None:
        nonlocal displayed
        write = output.update if displayed else output.display
        displayed = True
        write({"text/plain": str(bar)}, raw=True)

    try:
        yield draw
    finally:
        if displayed:
            draw("")


def summed(report: Report, done: float, whole: float) -> Callable[[float], None]:
    """Return a function that adds a piece of work to the work done, and reports the sum."""

    def add(work: float) -> None:
        nonlocal done
        done += work
        report(done, whole)

    return add


@contextlib.contextmanager
def counter(runs: int, steps: int, shown: ProgressTo) -> Iterator[Callable[[int], None]]:
    """Yield a function that adds simulated steps.

    A bar shows how many are done and how many per second.
    """
    start = time.monotonic()
    done = 0

    def stepped(count: int) -> None:
        nonlocal done
        done += count
        spent = time.monotonic() - start
        complete = runs * done / steps if steps else 0.0
        rate = complete / spent if spent else 0.0
        drawn.says(
            f"{math.floor(complete + 1e-9)} of {runs} simulations, {rate:.3g} per second",
            count,
        )

    with bar("", steps, shown=shown if runs else False) as drawn:
        stepped(0)
        yield stepped
