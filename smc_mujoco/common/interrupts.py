"""Ctrl-C, delayed while something must not stop halfway: a library that loads, numba that
compiles.
"""

import contextlib
import signal
import threading
from collections.abc import Iterator


@contextlib.contextmanager
def delay_ctrl_c() -> Iterator[None]:
    """Delay Ctrl-C to the end of a with block.

    Other threads never receive it, so they delay nothing.
    """
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    pressed = []
    signal.signal(signal.SIGINT, lambda number, frame: pressed.append((number, frame)))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if pressed:
            handler(*pressed[-1])
