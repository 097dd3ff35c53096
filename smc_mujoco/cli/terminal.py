"""What commands share: errors as sentences, loading that Ctrl-C cannot break, and a clock."""

import contextlib
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from smc_mujoco.common.errors import ScenarioError, printable
from smc_mujoco.common.interrupts import held_back

if TYPE_CHECKING:
    from rich.console import Console


@contextlib.contextmanager
def mendable() -> Iterator[None]:
    """End the command with one sentence on an error that the user can mend, and on Ctrl-C."""
    try:
        yield
    except ScenarioError as error:
        _fail(str(error))
    except BrokenPipeError:  # who read has had enough, as head does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(1) from None
    except OSError as error:
        _fail(f"{error.filename or 'a file'}: {error.strerror or error}; choose another folder or make room")
    except MemoryError:
        _fail("no memory for all this: give fewer or shorter runs")
    except KeyboardInterrupt:
        _fail("stopped; files already written are complete", 130)


def _fail(sentence: str, code: int = 2) -> None:
    print(f"smc-mujoco: {printable(sentence)}", file=sys.stderr)
    raise SystemExit(code)


def wrote(console: "Console", path: Path) -> None:
    """Say which file was written, on one line."""
    console.print(f"wrote {printable(str(path))}", soft_wrap=True, highlight=False, markup=False)


def loading() -> contextlib.AbstractContextManager[None]:
    """Hold Ctrl-C back while libraries load: they cannot be interrupted halfway."""
    return held_back()


class Clock:
    """Seconds spent in named stretches."""

    def __init__(self):
        self.spent: dict[str, float] = {}

    @contextlib.contextmanager
    def __call__(self, what: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.spent[what] = self.spent.get(what, 0.0) + time.perf_counter() - start

    def __str__(self) -> str:
        parts = [f"{what} {seconds:.2f} s" for what, seconds in self.spent.items()]
        return ", ".join([*parts, f"in all {sum(self.spent.values()):.2f} s"])
