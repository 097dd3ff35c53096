"""The numbers of boards as text, with their headings and units, and the order of laws."""

import dataclasses
import math
from collections.abc import Sequence

from smc_mujoco.analysis.paired_runs import OBJECTIVE, SETTLES
from smc_mujoco.common.aliases import Pair
from smc_mujoco.common.text import in_one_notation, number
from smc_mujoco.metrics.catalogue import CATALOGUE
from smc_mujoco.studies.board import Board


def in_order(boards: Sequence[Board]) -> list[str]:
    """Return the laws of boards by place in the first one, those of one place by their median in
    it, then by the next ones.
    """
    places: dict[str, list[Pair]] = {}
    for board in boards:
        for entry in board.entries:
            standing = entry.rank.place, entry.interval.median
            places.setdefault(entry.law, []).append(standing)
    return sorted(places, key=lambda law: (places[law], law))


def median_text(value: float, metric: str) -> str:
    """Return a median as text: "" for NaN, a share in percent."""
    if math.isnan(value):
        return ""
    if metric == OBJECTIVE:
        return number(value)
    if metric == SETTLES:
        return f"{100 * value:.0f}"
    return CATALOGUE[metric].text(value)


def sizes(values: Sequence[float], metric: str) -> list[str]:
    """Return numbers of one cell as text, each as `median_text` does, in one notation."""
    texts = []
    for value, text in zip(values, in_one_notation(values), strict=True):
        is_word = metric == SETTLES or not math.isfinite(value)
        texts.append(median_text(value, metric) if is_word else text)
    return texts


def heading(board: Board, about: str = "", of_unit: str = "") -> str:
    """Return a metric's label with its unit, if that is known, and what is said `about` each."""
    unit = "%" if board.metric == SETTLES else unit_of(board)
    return f"{board.label}{about} ({unit}{of_unit})" if unit else f"{board.label}{about}"


def unit_of(board: Board) -> str:
    """Return the unit of a board's medians; "" for a share, or where positions have none."""
    if board.metric not in CATALOGUE or not board.x:
        return "" if "{" in board.unit else board.unit
    # in the board's unit: in V for voltages
    return dataclasses.replace(CATALOGUE[board.metric], unit=board.unit).unit_for(board.x)
