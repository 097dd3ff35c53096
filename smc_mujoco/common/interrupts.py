"""Signals, such as Ctrl-C, delayed while something must not stop halfway: a library that loads, a
thread that is waited for.
"""

import contextlib
import signal
import threading
from collections.abc import Callable, Iterable, Iterator

NUMBERS = signal.valid_signals()  # asking for them takes longer than to delay them


@contextlib.contextmanager
def handling(
    handle: Callable[..., object], numbers: Iterable[int] = NUMBERS
) -> Iterator[dict[int, Callable[..., object]]]:
    """Call a function for each of some signals in a with block in place of its handler. Yield
    these, by signal.

    Other threads never receive a signal, so in them there are none.
    """
    handlers = {}
    if threading.current_thread() is threading.main_thread():
        for number in numbers:
            if callable(handler := signal.getsignal(number)):
                handlers[number] = handler
    try:
        for number in handlers:
            signal.signal(number, handle)
        yield handlers
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def delay_signals() -> Iterator[Callable[[], None]]:
    """Delay what Python does at a signal to the end of a with block.

    Yield a function that does now what has been delayed so far; it raises what a handler raises.
    """
    arrived = []
    handlers: dict[int, Callable[..., object]] = {}

    def deliver() -> None:
        while arrived:
            number, frame = arrived.pop(0)
            handlers[number](number, frame)

    try:
        with handling(lambda *arguments: arrived.append(arguments)) as before:
            handlers |= before
            yield deliver
    finally:
        deliver()
