"""Help of commands: commands and options in groups, and options that few users need only by
--help-all.

It is plain text, as rich's takes half of the time in which a person waits for it.
"""

import inspect
from collections.abc import Iterable, Iterator, Sequence
from contextvars import ContextVar
from itertools import pairwise
from typing import Any

from typer import BadParameter, style
from typer.core import TyperCommand, TyperGroup, TyperOption

from smc_mujoco.answers import command
from smc_mujoco.common.text import real

ALL = "--help-all"
ASKED, GAINS, OUTPUT, RARE = "What is asked", "Runs and gains", "Output", "Rarely used"
# option -> its group; the others are of what is asked
GROUPS: dict[str, str] = {}
GROUPS |= dict.fromkeys(("--seeds", "--quick", "--minutes"), GAINS)
GROUPS |= dict.fromkeys(("--out", "--figure", "--full", "--help"), OUTPUT)
GROUPS |= dict.fromkeys(("--tune", "--worst", "--latex", "--rig", "--film", "--falling"), RARE)
GROUPS |= dict.fromkeys(("--seed", "--relevant", "--allow-defaults", "--searches"), RARE)
GROUPS |= dict.fromkeys(("--gains", "--json", "--duration"), RARE)
GROUPS |= dict.fromkeys(("--threads", "--device", "--executor"), RARE)
MANY = 16  # options, with which a command's help has groups; chosen
_wants_all: ContextVar[bool] = ContextVar("wants_all", default=False)


class GroupedCommand(TyperCommand):
    """A command whose help has groups of options, if these are many."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the words of the command line, and remember which options take no value."""
        flags: list[str] = []
        names = {}  # option -> parameter of the command's function
        for param in self.get_params(ctx):
            if getattr(param, "is_flag", False):
                flags += [*param.opts, *param.secondary_opts]
            else:
                names |= dict.fromkeys(param.opts, param.name)
        command.remember_flags(flags)
        words = [part for word in args for part in word.split("=", 1)]
        rest = super().parse_args(ctx, args)
        for option, text in pairwise(words):
            if isinstance(ctx.params.get(names.get(option)), int | float):
                try:
                    real(text)
                except ValueError:
                    said = f"{text} is no number here: write it in the digits 0 to 9"
                    raise BadParameter(said, ctx) from None
        return rest

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the options and arguments, each option with its group."""
        params = super().get_params(ctx)
        options = [param for param in params if isinstance(param, TyperOption)]
        if len(options) >= MANY:
            self.epilog = f"{ALL} has further options: {_names(options)}."
            for option in options:
                option.rich_help_panel = GROUPS.get(option.opts[0], ASKED)
                option.hidden = option.rich_help_panel == RARE and not _wants_all.get()
        return params

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the arguments, then each group of options."""
        _write(formatter, _records(self, ctx))


class GroupedProgram(TyperGroup):
    """The program, whose help has groups of commands, each with its first sentences."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the groups of commands, then the options."""
        commands = []
        for name, listed in self.commands.items():
            sentences, _, _ = inspect.cleandoc(listed.help or "").partition("\n\n")
            commands.append((getattr(listed, "rich_help_panel", ""), name, sentences))
        _write(formatter, commands)
        _write(formatter, _records(self, ctx))


def _records(of: TyperCommand | TyperGroup, ctx: Any) -> Iterator[tuple[str, str, str]]:
    """Yield group, name and text of each argument and option that is shown."""
    for param in of.get_params(ctx):
        if record := param.get_help_record(ctx):
            usual = "Options" if isinstance(param, TyperOption) else "Arguments"
            yield (getattr(param, "rich_help_panel", None) or usual, *record)


def _write(formatter: Any, rows: Iterable[tuple[str, str, str]]) -> None:
    """Write rows (group, name, text) under the headings of their groups, in the same columns."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for group, name, text in rows:
        groups.setdefault(group, []).append((name, text))
    width = max(len(name) for of_group in groups.values() for name, _ in of_group)
    for group, of_group in groups.items():
        with formatter.section(style(group, bold=True)):
            formatter.write_dl([(name.ljust(width), text) for name, text in of_group])


def _names(options: Sequence[TyperOption]) -> str:
    """Return the names of the options that few need."""
    return ", ".join(option.opts[0] for option in options if GROUPS.get(option.opts[0]) == RARE)


def with_all(words: Sequence[str]) -> Sequence[str]:
    """Return the words of a command line with --help for --help-all, which then shows all."""
    _wants_all.set(ALL in words)
    return ["--help" if word == ALL else word for word in words]
