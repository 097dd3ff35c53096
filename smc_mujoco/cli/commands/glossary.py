"""smc-mujoco explain: what a word of an answer means."""

from typing import Annotated

import typer

from smc_mujoco.answers.explain import explain as meaning
from smc_mujoco.cli.commands import options
from smc_mujoco.cli.console import Terminal

Word = Annotated[
    list[str],
    typer.Argument(
        metavar="WORD",
        autocompletion=options.WORDS,
        help="A word that an answer or a table has, such as star, floor, J or settled.",
    ),
]


def explain(word: Word) -> None:
    """Say what a word of an answer means, in a few lines.

    Example: smc-mujoco explain star
    """
    Terminal().note(meaning(" ".join(word)))
