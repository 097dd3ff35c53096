"""The audit with a progress bar on stderr."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from smc_mujoco.claims import claims, evaluations
from smc_mujoco.claims.verdict import Claim

if TYPE_CHECKING:
    from smc_mujoco.table import Table


def watched(
    table: "Table | None" = None,
    only: Iterable[str] | None = None,
    gains: Sequence[str] | None = None,
    quick: bool = False,
    threads: int | None = None,
) -> list[Claim]:
    """`claims`, with a bar that counts claims times sets of gains; arguments as there."""
    ids = None if only is None else list(only)
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    with Progress(*columns, transient=True, console=Console(stderr=True)) as bar:
        task = bar.add_task("claims", total=evaluations(ids, gains, quick))
        return claims(table, ids, gains, quick, threads=threads, report=lambda done: bar.advance(task, done))
