"""Rigs in a report: who wins on a real machine's parameter sets, and how well its twin repeats
records of it.
"""

import dataclasses
import math
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from smc_mujoco.common.errors import ScenarioError, printable
from smc_mujoco.common.frozen import frozen
from smc_mujoco.common.text import capital
from smc_mujoco.control.source import in_words
from smc_mujoco.evidence.report import words
from smc_mujoco.evidence.report.plan import Report, Work
from smc_mujoco.evidence.rigs import ensemble, records
from smc_mujoco.evidence.rigs.rig import Fall, Rig, rig, rigs
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.board import Board
from smc_mujoco.studies.leaderboard import leaderboard
from smc_mujoco.studies.study import study

MAX_CURVE_POINTS = 1200  # of a curve; chosen


@dataclasses.dataclass(frozen=True, kw_only=True)
class Machine:
    """Laws compared on every parameter set of a rig: a board for each metric, whose conditions are
    the sets.
    """

    rig: Rig
    boards: tuple[Board, ...]

    @property
    def laws(self) -> dict[str, str]:
        """Name of each law -> its label, in the order of the rig."""
        return {law.name: words.style.law_name(law) for law in self.rig.laws}

    @property
    def colours(self) -> dict[str, str]:
        """Name of each law -> its colour, all different."""
        return dict(zip(self.laws, words.style.law_colours(self.rig.laws), strict=True))

    @property
    def gains(self) -> str:
        """Where the gains of the laws come from, in words."""
        return capital(in_words({words.style.law_name(law): [law.source] for law in self.rig.laws}))

    def unit(self, metric: str) -> str:
        """Return the unit of a metric on this machine."""
        return CATALOGUE[metric].unit_in(self.rig.scenario("none"))

    def sentence(self, board: Board) -> str:
        """Return who wins in a metric, and whether on every parameter set."""
        return f"{capital(words.metric(board.metric))}: {ensemble.sentence(board, self.laws)}."

    def medians(self, metric: str, law: str) -> list[float]:
        """Return a law's medians on the sets."""
        board = next(board for board in self.boards if board.metric == metric)
        return [block.medians[law] for block in board.blocks if law in block.medians]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Repeated:
    """A record that the twin repeated."""

    rig: Rig
    name: str  # of the record's file
    fits: Mapping[str, Mapping[str, float]] = frozen({})  # parameter set -> column -> percent
    t: np.ndarray = dataclasses.field(
        default_factory=lambda: np.empty(0)
    )  # s, (K,), thinned to few points
    measured: records.Record = dataclasses.field(default_factory=dict)  # column -> values, (K,)
    twin: records.Record = dataclasses.field(default_factory=dict)
    why: str = ""  # why it could not be repeated


def machines(work: Work) -> tuple[Machine, ...]:
    """Return the comparison of each rig's laws on its parameter sets."""
    plan = work.plan
    twins = []
    for name in plan.rigs:
        twin = rig(name)
        runs = ensemble.runs(twin, seeds=plan.seeds, duration=plan.duration)
        with work.bars.stage("rigs", f"{len(runs)} runs", bar=False):
            table = study(
                runs, work.folder / "rigs" / name, threads=work.threads, progress=work.bars.shown
            )
        twins.append(
            Machine(
                rig=twin,
                boards=tuple(leaderboard(table, words.MAIN_METRICS, relevant=plan.relevant)),
            )
        )
    return tuple(twins)


def repeated(work: Work, folder: Path | None) -> tuple[Repeated, ...]:
    """Return the records of a folder, each repeated by the twin of the machine whose columns it
    has.
    """
    files = [] if folder is None else read(folder)

    def compute(file: tuple[Path, Rig, Mapping[str, np.ndarray]], report: Report) -> Repeated:
        path, twin, record = file
        try:
            fits = {"the twin’s": twin.fit(record)}
            fits |= {name: twin.set(name).fits([record])[0] for name in twin.published}
            ((predicted, measured, t),) = twin.predictions([record])
        except ScenarioError as error:
            return Repeated(rig=twin, name=path.name, why=str(error))
        step = -(-len(t) // MAX_CURVE_POINTS)
        thin = []
        for columns in (measured, predicted):
            thin.append({name: values[::step] for name, values in columns.items()})
        return Repeated(
            rig=twin, name=path.name, fits=fits, t=t[::step], measured=thin[0], twin=thin[1]
        )

    if files:
        return tuple(work.each("records", "records", files, compute))
    return ()


def read(folder: Path) -> list[tuple[Path, Rig, Mapping[str, np.ndarray]]]:
    """Return the records in a folder with their rigs:

    CSV and npz files that have all columns of a rig.
    """
    if not os.path.isdir(folder):
        raise ScenarioError(
            f"no folder at {printable(str(folder))}: give one with records, CSV or npz files"
        )
    known = [twin for twin in map(rig, rigs()) if twin.free]
    files = []
    for path in sorted(file for file in folder.iterdir() if file.suffix in (".csv", ".npz")):
        record = records.load(path)
        if isinstance(record, Trace):
            continue
        mine = next((twin for twin in known if set(twin.needed) <= set(record)), None)
        if mine is not None:
            files.append((path, mine, record))
    if not files:
        has = "; ".join(f"{twin.name} {', '.join(twin.needed)}" for twin in known)
        raise ScenarioError(
            f"no record in {printable(str(folder))} has the columns of a rig: give those of one of {has}"
        )
    return files


def fit(values: Mapping[str, float]) -> str:
    """Return a fit in words: "theta 94.1, u 86.7 %", or "falls at 8.4 s"."""
    if -math.inf in values.values():
        return str(next(value for value in values.values() if isinstance(value, Fall)))
    return (
        ", ".join(f"{name} {value:z.1f}" for name, value in values.items())
        + f" {words.typeset('%')}"
    )
