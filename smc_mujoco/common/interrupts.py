"""Signals, such as Ctrl-C, delayed while something must not stop halfway: a library that loads, a
thread that is waited for.
"""

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator

NUMBERS = signal.valid_signals()  # asking for them takes longer than to delay them


@contextlib.contextmanager
def delay_signals() -> Iterator[Callable[[], None]]:
    """Delay what Python does at a signal to the end of a with block.

    Yield a function that does now what has been delayed so far; it raises what a handler raises.
    Other threads never receive a signal, so they delay nothing.
    """
    handlers = {}
    if threading.current_thread() is threading.main_thread():
        for number in NUMBERS:
            if callable(handler := signal.getsignal(number)):
                handlers[number] = handler
    arrived = []

    def deliver() -> None:
        while arrived:
            number, frame = arrived.pop(0)
            handlers[number](number, frame)

    try:
        for number in handlers:
            signal.signal(number, lambda *arguments: arrived.append(arguments))
        yield deliver
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        deliver()
