"""Fronts of error against price: how sets are chosen and sentences judged, by hand, and what it
takes to turn a sentence of the page.
"""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks import fronts
from benchmarks.fronts import CONDITIONS, FLOOR, LEVELS, SENTENCES, UNSEEN, Job, Sentence, Sets

POINTS = json.loads(Path(fronts.__file__).with_suffix(".json").read_text())  # of the page
SPREAD = np.exp(np.linspace(-0.05, 0.05, UNSEEN))


def point(law, error, level=2.0, **fields):
    """A point of a front, with runs about an error."""
    made = {"plant": "duffing", "model": "none", "law": law, "price": "J", "level": level}
    made |= {"lot": None, "period": 1e-3}
    made |= {"condition": "middle", "chose": error, "errors": (error * SPREAD).tolist()}
    return made | {"within": True} | fields


@pytest.mark.quick
@pytest.mark.parametrize(
    ("ours", "theirs", "said"),
    [
        (0.01, 0.02, "stands"),
        (0.01, 0.013, "open"),  # another search may find as much
        (0.02, 0.01, "contradicted"),
        (None, 0.01, "contradicted"),  # nothing at this price
        (0.01, None, "alone"),
        (FLOOR / 100, FLOOR / 2, "not ranked"),
        (FLOOR / 100, FLOOR * 2, "below the floor"),
        (FLOOR / 100, FLOOR * 1.3, "not ranked"),  # another search may find it below, too
        (FLOOR * 2, FLOOR / 100, "contradicted"),
        (math.nan, 0.01, "contradicted"),  # a run that fails is behind all others
    ],
)
def test_a_sentence_is_judged_by_the_lead_at_the_prices_that_it_is_about(ours, theirs, said):
    sentence = Sentence("one", ("super_twisting",), ("pid",), ("middle",), high=3.0)
    points = []
    for law, error in (("super_twisting", ours), ("pid", theirs)):
        for change in ({"level": 4.0}, {"model": "nominal"}, {"price": "rate"}):
            points.append(point(law, 1.0, **({"level": 2.5} | change)))
        if error is not None:
            points.append(point(law, error))
    (found,) = fronts.judged(points, [sentence])
    assert found.verdict == said
    if said in ("stands", "open"):
        assert found.lead == pytest.approx(theirs / ours)
        assert found.low <= found.lead <= found.high
    assert not list(fronts.judged(points, [sentence._replace(within=False)]))


@pytest.mark.quick
def test_a_level_buys_the_least_error_among_sets_that_have_settled():
    errors = np.tile([[0.3], [0.2], [0.1], [0.05]], (1, len(CONDITIONS)))
    settled = np.ones(errors.shape, bool)
    settled[3] = False
    J = np.array([1.0, 2.0, 4.0, 1.5])
    sets = Sets(np.zeros((4, 1)), J, errors, settled, np.array([50.0, 5.0, 500.0, 5.0]))
    found = {}
    for price, level, condition, i in fronts.chosen(sets, LEVELS, 1.0):
        if condition == 0:
            found[price, level] = i
    bought = [found[at] for at in (("J", 1.5), ("J", 3.0), ("J", 5.0), ("rate", 30.0))]
    assert bought == [0, 1, 2, 1]
    just = fronts.chosen(sets, {"J": (4.0,)}, 1.0)  # 4 is within the margin of its level
    assert [i for *_, condition, i in just if condition == 0] == [1]
    assert [*fronts.on_front(sets)] == [True, True, True, False]


@pytest.mark.quick
def test_a_lot_draws_loads_and_prices_of_its_seed_and_plant():
    conditions, levels = fronts.by_lot(7, "duffing")
    assert (conditions, levels) == fronts.by_lot(7, "duffing")
    assert conditions != fronts.by_lot(8, "duffing")[0]
    assert conditions != fronts.by_lot(7, "arm.xml:elbow")[0]
    for given, drawn in zip(CONDITIONS, conditions, strict=True):
        assert drawn.kind == given.kind
        assert 0.5 * given.noise <= drawn.noise <= 2.0 * given.noise
        assert 0.7 * given.ratio <= drawn.ratio <= 1.4 * given.ratio
    for price, its in LEVELS.items():
        assert its[0] <= min(levels[price]) <= max(levels[price]) <= its[-1]


@pytest.mark.quick
def test_the_points_of_the_page_bear_its_sentences():
    found = list(fronts.judged(POINTS))
    assert {one.sentence for one in found} == {sentence.name for sentence in SENTENCES}
    assert not [one for one in found if one.verdict == "contradicted"]
    assert 5 * sum(one.verdict == "open" for one in found) <= len(found)


@pytest.mark.slow
@pytest.mark.parametrize("sentence", SENTENCES, ids=[sentence.name for sentence in SENTENCES])
def test_no_change_of_one_gain_of_a_losing_law_turns_a_sentence(sentence):
    """By 3, 10 or 30 either way: it costs more than the price, or its error is larger still."""
    kinds = [condition.kind for condition in CONDITIONS]
    benches = {}
    for _, first, second in fronts.compared(POINTS, [sentence]):
        if not (first and second) or first["level"] not in (0.0, 1.5, 2.0, 3.0, 6.0, 100.0):
            continue
        job = Job(
            second["plant"], second["law"], sentence.model, second["wc"], CONDITIONS, 0, "cpu"
        )
        bench = benches.setdefault(job, None) or fronts.Bench(job)
        benches[job] = bench
        changed = np.repeat([list(second["gains"].values())], 6 * len(bench.names), axis=0)
        for i, (gain, factor) in enumerate(np.ndindex(len(bench.names), 6)):
            changed[i, gain] *= (1 / 30, 1 / 10, 1 / 3, 3.0, 10.0, 30.0)[factor]
        sets = bench.judged(changed, 1)
        if sentence.price == "least":
            assert (np.nan_to_num(sets.J, nan=np.inf) > first["J"][0]).all()
            continue
        cost = sets.rates if sentence.price == "rate" else sets.J / second["least"]
        error = np.maximum(sets.errors[:, kinds.index(second["condition"])], FLOOR)
        turned = (cost <= first["level"]) & (error < fronts.values(first)[0])
        assert not turned.any(), (first["law"], second["law"], first["level"], changed[turned])
