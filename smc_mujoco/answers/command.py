"""The command that is running, so that an answer can give it again with other options."""

import shlex
from collections.abc import Mapping, Sequence
from contextvars import ContextVar

PROGRAM = "smc-mujoco"
ARGUMENTS = {"condition": "conditions", "law": "laws"}  # an option -> its argument in Python
_typed: ContextVar[tuple[str, ...]] = ContextVar("typed", default=())


def remember(words: Sequence[str]) -> None:
    """Remember the words of a command line, without the program's name."""
    _typed.set(tuple(words))


def again(options: Mapping[str, str]) -> str:
    """Return the command that is running, with these options in place of its own, such as
    {"--seeds": "24"}; where Python runs, the arguments that differ in the call.
    """
    if not _typed.get():
        arguments = []
        for option, value in options.items():
            name = option.removeprefix("--").replace("-", "_")
            written = int(value) if value.isdigit() else value or True
            arguments.append(f"{ARGUMENTS.get(name, name)}={written!r}")
        return f"the same call with {', '.join(arguments)}"
    words = []
    skip = False
    for word in _typed.get():
        if skip:
            skip = False
        elif word.partition("=")[0] in options:
            skip = "=" not in word
        else:
            words.append(word)
    extra = [part for pair in options.items() for part in pair if part]
    return shlex.join([PROGRAM, *words, *extra])
