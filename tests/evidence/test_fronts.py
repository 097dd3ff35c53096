"""Fronts of error against price: how sets are chosen and sentences judged, by hand; and the physics
that the sentences rest on, against integrations of the tests' own.
"""

import math

import numpy as np
import pytest

from benchmarks import fronts
from benchmarks.fronts import CONDITIONS, FLOOR, LEVELS, UNSEEN, Sentence, Sets

KINDS = tuple(condition.kind for condition in CONDITIONS)
SPREAD = np.exp(np.linspace(-0.05, 0.05, UNSEEN))


def point(law, error, level=2.0, **fields):
    """A point of a front, with runs about an error and J of 1."""
    made = {"plant": "duffing", "model": "none", "law": law, "price": "J", "level": level}
    made |= {"condition": "middle", "chose": error, "errors": (error * SPREAD).tolist()}
    made |= {"J": SPREAD.tolist(), "rates": SPREAD.tolist(), "within": True}
    return made | fields


@pytest.mark.quick
@pytest.mark.parametrize(
    ("ours", "theirs", "said"),
    [
        (0.01, 0.02, "stands"),
        (0.01, 0.013, "open"),  # another search may find as much
        (0.02, 0.01, "contradicted"),
        (None, 0.01, "contradicted"),  # nothing at this price
        (0.01, None, "stands"),
        (FLOOR / 100, FLOOR / 2, "not ranked"),
        (FLOOR / 100, FLOOR * 2, "stands"),
        (math.nan, 0.01, "contradicted"),  # a run that fails is behind all others
    ],
)
def test_a_sentence_is_judged_by_the_lead_at_one_price(ours, theirs, said):
    sentence = Sentence("one", ("super_twisting",), ("pid",), ("middle",), high=8.0)
    points = [point("super_twisting", 1.0, level=9.0), point("pid", 1.0, level=9.0)]
    for law, error in (("super_twisting", ours), ("pid", theirs)):
        if error is not None:
            points.append(point(law, error))
    (found,) = fronts.judged(points, [sentence])
    assert found.verdict == said


@pytest.mark.quick
def test_a_sentence_is_about_its_plant_model_condition_price_and_theorem():
    sentence = Sentence("one", ("pid",), ("lqi",), ("middle",), low=1.5, high=3.0, within=True)
    about = [point("pid", 0.01), point("lqi", 0.03)]
    others = []
    for change in ({"level": 4.0}, {"model": "nominal"}, {"price": "rate"}, {"condition": "fast"}):
        others += [one | change for one in about]
    others.append(about[0] | {"level": 1.6, "within": False})
    (found,) = fronts.judged(about + others, [sentence])
    assert found.lead == pytest.approx(3.0, rel=0.01)


@pytest.mark.quick
def test_the_best_of_several_laws_is_chosen_where_no_lead_is_read():
    points = [point("pid", 0.01, chose=0.02), point("lqi", 0.03, chose=0.01)]
    best = fronts.best(points, ("pid", "lqi"))
    assert best is not None
    assert best["law"] == "lqi"


@pytest.mark.quick
def test_a_level_buys_the_least_error_among_sets_that_have_settled():
    errors = np.tile([[0.3], [0.2], [0.1], [0.05]], (1, len(KINDS)))
    settled = np.ones(errors.shape, bool)
    settled[3] = False
    J = np.array([1.0, 2.0, 4.0, 1.5])
    sets = Sets(np.zeros((4, 1)), J, errors, settled, np.array([50.0, 5.0, 500.0, 5.0]))
    found = {}
    for price, level, condition, i in fronts.chosen(sets, LEVELS, 1.0):
        if condition == 0:
            found[price, level] = i
    assert found["J", 1.5] == 0
    assert found["J", 3.0] == 1
    assert found["J", 4.0] == 1  # within the margin of the level
    assert found["J", 6.0] == 2
    assert found["rate", 10.0] == 1
    assert found["rate", 1000.0] == 2
    assert [*fronts.on_front(sets)] == [True, True, True, False]


@pytest.mark.quick
@pytest.mark.parametrize("plant", ["duffing", "arm.xml:elbow"])
def test_a_lot_draws_loads_and_prices_of_its_seed_and_plant(plant):
    conditions, levels = fronts.by_lot(7, plant)
    assert (conditions, levels) == fronts.by_lot(7, plant)
    assert conditions != fronts.by_lot(8, plant)[0]
    assert conditions != fronts.by_lot(7, "another")[0]
    assert tuple(condition.kind for condition in conditions) == KINDS
    force, ratio, other = fronts.DRAWN
    for given, drawn in zip(CONDITIONS, conditions, strict=True):
        assert force[0] * given.force <= drawn.force <= force[1] * given.force
        assert ratio[0] * given.ratio <= drawn.ratio <= ratio[1] * given.ratio
        assert other[0] * given.noise <= drawn.noise <= other[1] * given.noise
        assert other[0] * given.delay <= drawn.delay <= other[1] * given.delay
    for price, its in LEVELS.items():
        assert its[0] <= min(levels[price]) <= max(levels[price]) <= its[-1]
