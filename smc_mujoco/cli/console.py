"""Console, clock, and errors as sentences, for all commands."""

import contextlib
import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from smc_mujoco.common.attended import (
    ENDED_BY_CTRL_C,
    STOPPED,
    ignore_ctrl_c,
    raising,
    stop_at_once,
)
from smc_mujoco.common.errors import ScenarioError, printable
from smc_mujoco.common.files import to_json, with_ending, writable, write_json
from smc_mujoco.common.interrupts import handling
from smc_mujoco.common.scripts import users_traceback

if TYPE_CHECKING:
    from smc_mujoco.answers.answer import Answer


@contextlib.contextmanager
def errors_as_sentences() -> Iterator[None]:
    """Exit with a sentence on an error that the user can correct; with a traceback of their script
    if it fails.
    """
    try:
        with raising():
            yield
    except ScenarioError as error:
        _fail(str(error))
    except BrokenPipeError:  # the reader has closed the pipe, as head does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(1) from None
    except KeyboardInterrupt:
        if signal.getsignal(signal.SIGINT) is stop_at_once:  # the process is the program's
            ignore_ctrl_c()  # another one would interrupt its end
        _fail(STOPPED, ENDED_BY_CTRL_C)
    except Exception as error:
        if lines := users_traceback(error):
            print(lines, end="", file=sys.stderr)
            raise SystemExit(1) from None
        if isinstance(error, OSError):
            _fail(
                f"{error.filename or 'a file'}: {error.strerror or error}; choose another "
                "folder or make room"
            )
        if isinstance(error, MemoryError):
            _fail("out of memory: give fewer or shorter runs")
        raise


def _fail(sentence: str, code: int = 2) -> None:
    print(f"smc-mujoco: {printable(sentence)}", file=sys.stderr)
    raise SystemExit(code)


@contextlib.contextmanager
def importing() -> Iterator[None]:
    """Let Ctrl-C end the command at once in a with block that only imports: the rest of it may take
    seconds, and a library that is half imported crashes.
    """
    with handling(stop_at_once, (signal.SIGINT, signal.SIGTERM)):  # others are a caller's own
        yield


STDOUT = Path("-")  # as a file: standard output


class Terminal(Console):
    """The console of a command, which also measures its time and can write what it printed as JSON.
    Where that goes to standard output, what it prints goes to standard error.

    It prints brackets as they are, not as markup.
    """

    def __init__(self, json: Path | None = None):
        super().__init__(markup=False, emoji=False, stderr=json == STDOUT)
        self.start = time.perf_counter()
        self.json = json
        self.printed: list[Any] = []
        if json != STDOUT:
            writable(json and with_ending(json, ".json"))

    @property
    def seconds(self) -> float:
        """Seconds since the console was made."""
        return time.perf_counter() - self.start

    def print(self, *objects: Any, **options: Any) -> None:
        """Print, and remember it for `finish`."""
        self.printed += objects
        super().print(*objects, **options)

    def answer(self, result: "Answer", full: bool = False) -> None:
        """Print a result's answer, or with `full` its evidence; remember it for `finish`."""
        self.printed.append(result)
        if full:
            super().print(result.full)
        else:
            self.note(str(result))

    def note(self, text: str, style: str | None = None, wrap: bool = False) -> None:
        """Print text without coloured numbers, on one line unless `wrap`."""
        super().print(text, style=style, soft_wrap=not wrap, highlight=False)

    def wrote(self, *files: Path) -> None:
        """Print the names of files that were written."""
        for file in files:
            self.note(f"wrote {printable(str(file))}")

    def finish(self, data: Any = None) -> None:
        """Write the file of --json, if there is one: `data`, or else what was printed."""
        if self.json is not None:
            from smc_mujoco.cli.tables import document

            written = document(self.printed) if data is None else data
            if self.json == STDOUT:
                print(to_json(written))
            else:
                self.wrote(write_json(self.json, written))
