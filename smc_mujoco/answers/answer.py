"""Results in three layers: an answer that fits a screen, the evidence, and where words are
explained.
"""

import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from smc_mujoco.answers.answers import screen_html, screen_lines
from smc_mujoco.answers.explain import explain
from smc_mujoco.answers.facts import Screen
from smc_mujoco.common import html
from smc_mujoco.common.aliases import AnyPath, Names
from smc_mujoco.common.files import write_text
from smc_mujoco.common.tabular import Tables, Tabular

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderableType


class Evidence(Tables):
    """The second layer of a result: all its tables, which print as such."""

    def __init__(self, tables: Sequence[Tabular]):
        self._tables = tables

    @property
    def tables(self) -> Sequence[Tabular]:
        """The tables, in their order."""
        return self._tables


class Answer(Tables):
    """Base of results with three layers.

    `print` and a notebook show `lines`; `full` prints `tables`; `to_html` writes all of it. A
    subclass has `screen` and `tables`, and `title` and `pictures` for its page.
    """

    @property
    def screen(self) -> Screen:
        """The facts of the answer."""
        raise NotImplementedError

    @property
    def lines(self) -> list[str]:
        """The answer, at most 80 characters wide."""
        return screen_lines(self.screen)

    @property
    def title(self) -> str:
        """The title of the page."""
        return self.lines[0]

    @property
    def pictures(self) -> Sequence[html.Html]:
        """The pictures of the page."""
        return ()

    @property
    def words(self) -> Names:
        """The words that the page explains below its tables."""
        return ()

    @property
    def full(self) -> Evidence:
        """The evidence: all tables, with their notes."""
        return Evidence(self.tables)

    def __str__(self) -> str:
        return "\n".join(self.lines)

    def __rich_console__(
        self, console: "Console", options: "ConsoleOptions"
    ) -> "Iterator[RenderableType]":
        from rich.text import Text

        # a line that is longer than the terminal is a command: it stays whole
        yield Text("\n".join(self.lines), no_wrap=True, overflow="ignore")

    def _repr_html_(self) -> str:
        evidence = f"<details><summary>all tables</summary>{super()._repr_html_()}</details>"
        return screen_html(self.screen) + evidence

    def to_html(self, path: AnyPath) -> Path:
        """Write the answer and all its evidence as one page that needs no other file.

        The page suits a phone, and follows the browser's dark mode.

        Args:
          path: of the file.

        Returns:
          The path.

        Raises:
          ScenarioError: a file that cannot be written.
        """
        screen = dataclasses.replace(self.screen, report="")  # the page does not point at itself
        parts = [screen_html(screen), *self.pictures]
        for table in self.tables:
            parts.append(table.as_html())
        if self.words:
            rows = [explain(word).split("\n", 1) for word in self.words]
            words = Tabular(headings=("word", "meaning"), rows=rows, name_columns=2)
            parts.append(words.as_html())
        return write_text(Path(path), html.page(self.title, parts))
