"""The figure of Pareto fronts: every law with its staircase and its chosen gains, and no unfair
comparison.
"""

import dataclasses
from collections.abc import Sequence

import pytest
from matplotlib.figure import Figure

from smc_mujoco.analysis.tuning.objective import Evaluation, Objective
from smc_mujoco.analysis.tuning.result import Tuned
from smc_mujoco.analysis.tuning.search import tune
from smc_mujoco.draw import page as pages
from smc_mujoco.draw import pareto as drawing
from smc_mujoco.draw.pareto import MIN_VARIATION

LEAN = Objective(conditions=("nominal",), duration=0.5)


@pytest.fixture(scope="module")
def pair() -> list[Tuned]:
    return [
        tune("duffing", law, budget=12, objective=LEAN, searches=1)
        for law in ("observer_free", "classical")
    ]


def with_history(tuned: Tuned, history: Sequence[Evaluation]) -> Tuned:
    """The tuning, with other evaluations in its first search."""
    best = min(history, key=lambda one: one.objective)
    found = dataclasses.replace(tuned.searches[0], history=tuple(history), best=best)
    return dataclasses.replace(tuned, searches=(found,))


def pareto(tunings, path) -> list:
    """The files that a figure is written to."""
    drawing.pareto(tunings, path)
    return pages.files(path)


@pytest.fixture
def page(monkeypatch) -> list[Figure]:
    """The pages that are drawn."""
    drawn = []
    write = pages.write
    monkeypatch.setattr(
        pages, "write", lambda page, paths: (drawn.append(page), write(page, paths))[1]
    )
    return drawn


@pytest.mark.parametrize(
    "size",
    [
        None,
        (6.0, 4.0),
    ],
)
def test_a_front_is_the_best_that_was_tried_and_the_better_law_is_named_first(pair, size):
    fronts = [((1.0, 90.0), (2.0, 40.0), (3.0, 60.0), (4.0, 10.0)), ((1.5, 300.0), (2.5, 0.0))]
    made = []
    for tuned, front in zip(pair, fronts, strict=True):
        gains = tuned.history[0].gains
        history = tuple(Evaluation(gains, x + 1e-3 * y, x, y) for x, y in front)
        made.append(with_history(tuned, history))
    drawn = drawing.pareto(made[::-1], size=size, title="Fronts" if size else None)
    (ax,) = drawn.axes
    assert [ax.get_xlabel().rpartition(" ")[2], ax.get_ylabel().rpartition(" ")[2]] == [
        "(s²)",
        "(1/s)",
    ]
    stairs = []
    for line in ax.lines[::2]:
        stairs.append(line.get_xydata().tolist())
    assert stairs == [[[1.0, 90.0], [2.0, 40.0], [4.0, 10.0]], [[1.5, 300.0], [2.5, MIN_VARIATION]]]
    words = []
    for text in drawn.legends[0].get_texts():
        words.append(text.get_text())
    assert [word.split(" = ")[0] for word in words[:2]] == ["Observer-free: J", "Classical: J"]
    assert [word.split(" = ")[1] for word in words[:2]] == ["1.09 s²", "1.8 s²"]
    samples = drawn.legends[0].get_lines()[:2]
    assert [sample.get_color() for sample in samples] == [
        line.get_color() for line in ax.lines[::2]
    ]


def test_no_tried_gains_lie_below_the_staircase_and_the_chosen_ones_are_on_it(pair, page, tmp_path):
    pareto(pair, tmp_path / "fronts")
    (ax,) = page[0].axes
    stairs = ax.lines[0:4:2]
    rings = ax.lines[1:4:2]
    for tuned, stair, ring in zip(
        sorted(pair, key=lambda one: one.objective), stairs, rings, strict=True
    ):
        assert stair.get_drawstyle() == "steps-post"
        corners = [(float(x), float(y)) for x, y in zip(*stair.get_data(), strict=True)]
        for one in tuned.history:
            # the stair's height above what was tried
            reached = []
            for x, y in corners:
                if x <= one.tracking:
                    reached.append(y)
            assert one.failed or min(reached) <= max(one.variation, MIN_VARIATION)
        (place,) = zip(*ring.get_data(), strict=True)
        assert place in corners
        assert place[0] + 1e-3 * place[1] == pytest.approx(tuned.objective, rel=1e-3)
    assert stairs[0].get_marker() != stairs[1].get_marker()
    assert stairs[0].get_color() != stairs[1].get_color()
