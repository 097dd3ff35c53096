"""The command that is running, so that an answer can give it again with other options."""

import itertools
import shlex
from collections.abc import Iterable, Mapping, Sequence
from contextvars import ContextVar

PROGRAM = "smc-mujoco"
ARGUMENTS = {"condition": "conditions", "law": "laws"}  # an option -> its argument in Python
_typed: ContextVar[tuple[str, ...]] = ContextVar("typed", default=())
_flags: ContextVar[frozenset[str]] = ContextVar("flags", default=frozenset())
_doubted: ContextVar[str] = ContextVar("doubted", default="")


def remember(words: Sequence[str]) -> None:
    """Remember the words of a command line, without the program's name."""
    _typed.set(tuple(words))
    _doubted.set("")


def remember_flags(flags: Iterable[str]) -> None:
    """Remember the options of the command that take no value."""
    _flags.set(frozenset(flags))


def doubt(sentence: str) -> None:
    """Remember the first doubt about a value of the command that is running."""
    if not _doubted.get():
        _doubted.set(sentence)


def doubted() -> str:
    """Return a doubt about a value of the command that is running; "" without one, or a command."""
    return _doubted.get() if _typed.get() else ""


Options = Mapping[str, str | None]  # option -> value; "" of a flag, None for one to leave out


def again(options: Options, without: Sequence[str] = ()) -> str:
    """Return the command that is running, with these options in place of its own, such as
    {"--seeds": "24"}, and `without` some flags, which these replace; where Python runs, the
    arguments that differ.
    """
    if not _typed.get():
        arguments = []
        for option, value in (options or dict.fromkeys(without, "False")).items():
            name = option.removeprefix("--").replace("-", "_")
            arguments.append(f"{ARGUMENTS.get(name, name)}={_written(value)}")
        return f"the same call with {', '.join(arguments)}"
    words = [word for word in _others(options) if word not in without]
    return shlex.join([PROGRAM, *words, *_flat(options)])


def typed(option: str) -> str:
    """Return the value of an option of the command that is running; "" without it."""
    words = _typed.get()
    for word, value in itertools.pairwise(words):
        if word == option:
            return value
    return next((word.partition("=")[2] for word in words if word.startswith(f"{option}=")), "")


def instead(command: str, options: Options, shared: Sequence[str] = ()) -> str:
    """Return another command with the arguments, and the `shared` options, of the one that is
    running, and further options; where Python runs, its name.
    """
    words_typed = _typed.get()
    if not words_typed:
        return f"smc.{command}"
    words = command.split()
    for i, word in enumerate(words_typed[1:], 1):
        if not word.startswith("-"):
            before = words_typed[i - 1]
            if not before.startswith("-") or before in _flags.get():
                words.append(word)
            elif before in shared:
                words += words_typed[i - 1 : i + 1]
        elif "=" in word and word.partition("=")[0] in shared:
            words.append(word)
    return shlex.join([PROGRAM, *words, *_flat(options)])


def _written(value: str | None) -> str:
    """Return a value as Python writes it."""
    if value in ("", "False", None):
        return "True" if value == "" else str(value)
    return value if value.isdigit() else repr(value)


def _others(options: Options) -> list[str]:
    """Return the words of the running command without these options and their values."""
    words = []
    skip = False
    for word in _typed.get():
        if skip:
            skip = False
        elif word.partition("=")[0] in options:
            skip = "=" not in word and options[word] != ""
        else:
            words.append(word)
    return words


def _flat(options: Options) -> list[str]:
    """Return the options and their values as words."""
    words = []
    for option, value in options.items():
        if value is not None:
            words += filter(None, (option, value))
    return words
