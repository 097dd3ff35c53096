"""smc-mujoco explain: what a word of an answer means."""

from typing import Annotated

import typer

from smc_mujoco.answers.explain import explain as meaning
from smc_mujoco.answers.explain import glossary
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
    """Say what a word of an answer means, in a few lines. It may be a metric's name, too.

    Example: smc-mujoco explain star
    """
    terminal = Terminal()
    asked_word = " ".join(word)
    if asked_word not in glossary():
        from smc_mujoco.metrics.catalogue import CATALOGUE

        for metric in CATALOGUE.values():
            if asked_word.casefold() in (metric.name, metric.label.casefold()):
                terminal.note(f"{metric.label}\n{metric.summary}", wrap=True)
                return
        from smc_mujoco.control.law import all_laws
        from smc_mujoco.mechanisms.plant import plants
        from smc_mujoco.simulation.conditions import NAMED

        for what, names in (("law", all_laws()), ("plant", plants()), ("condition", NAMED)):
            if asked_word in names:
                terminal.note(f"{asked_word} is a {what}: smc-mujoco list {asked_word}")
                return
    terminal.note(meaning(asked_word))
