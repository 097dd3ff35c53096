"""Whose a claim is decides what is counted, and what is said of all or some gains is decided by one
set of them.
"""

import pytest

from smc_mujoco.evidence.audit.audit import audit
from smc_mujoco.evidence.audit.verdict import over_gains

pytestmark = pytest.mark.quick

DATA = """
title = "t"
authors = "a"
source = "s"
read = "abstract"
[gains.paper]
classical = {{ k = 2.0, c = 1.0 }}
[allowed.classical]
k = [1.0, 9.0]
{margins}
[[claim]]
id = "1"
whose = "paper"
over = "{over}"
text = "k is as it should be"
where = "p. 1"
function = "gain"
plants = {plants}
laws = ["classical"]
holds_if = {{ "gain" = "{limit}" }}
"""
CODE = """
def gain(runs):
    return {"gain": {plant: runs.law(plant, "classical").gains["k"] for plant in runs.plants}}
def margins(gains):
    return {"k < 5": 5.0 - gains["k"]}
"""


@pytest.fixture
def written(tmp_path):
    def write(data, code=CODE):
        (tmp_path / "paper.toml").write_text(data)
        (tmp_path / "claims.py").write_text(code)
        return tmp_path

    return write


def decided(folder):
    (claim,) = audit(folder).claims
    return claim.verdict, claim.beside["paper"]


def test_all_gains_are_refuted_by_one_that_the_theorem_allows_with_its_margin(written):
    folder = written(
        DATA.format(
            over="all",
            limit="< 4",
            plants='["duffing"]',
            margins='margins = "margins"',
        )
    )
    verdict, beside = decided(folder)
    assert verdict == "refuted"
    assert 4.0 <= beside["decided at k"] < 5.0
    assert beside["margin of k < 5"] == pytest.approx(5.0 - beside["decided at k"])
    assert decided(folder) == (verdict, beside)


def test_gains_outside_the_conditions_are_no_counter_example(written):
    conditions = 'margins = "margins"'
    assert (
        decided(
            written(
                DATA.format(
                    over="all",
                    limit="< 5",
                    plants='["duffing"]',
                    margins=conditions,
                )
            )
        )[0]
        == "supported"
    )
    assert (
        decided(
            written(
                DATA.format(
                    over="all",
                    limit="< 5",
                    plants='["duffing"]',
                    margins="",
                )
            )
        )[0]
        == "refuted"
    )


def test_some_gains_are_enough_on_each_plant_and_the_set_s_own_are_tried_first(written):
    two_plants = '["duffing", "van_der_pol"]'
    verdict, beside = decided(
        written(
            DATA.format(
                over="some",
                limit="> 3",
                plants=two_plants,
                margins="",
            )
        )
    )
    assert verdict == "supported"
    assert min(beside["duffing: decided at k"], beside["van_der_pol: decided at k"]) > 3.0
    first = decided(
        written(
            DATA.format(
                over="some",
                limit="> 1",
                plants=two_plants,
                margins="",
            )
        )
    )[1]
    assert first["duffing: decided at k"] == 2.0
    assert first["duffing: sets of gains tried"] == 1
    assert (
        decided(
            written(
                DATA.format(
                    over="some",
                    limit="> 9",
                    plants=two_plants,
                    margins="",
                )
            )
        )[0]
        == "not shown"
    )


TWO_SETS = """
[gains.other]
classical = {{ k = 8.0, c = 1.0 }}
"""


@pytest.mark.parametrize(
    ("rivals", "limit", "verdict"),
    [
        ("paper", "> 8.5", "supported"),
        ("paper", "> 9", "not shown"),
        ("other", "< 1.5", "supported"),
    ],
)
def test_a_set_of_rivals_gains_decides_by_a_search_and_other_sets_are_told_beside_it(
    written, rivals, limit, verdict
):
    data = DATA.format(
        over="some",
        limit=limit,
        plants='["duffing"]',
        margins="tried = [40, 10]",
    )
    data = data.replace("[allowed", TWO_SETS.format() + "[allowed").replace(
        "over =", f'rivals = "{rivals}"\nover ='
    )
    (claim,) = audit(written(data)).claims
    (beside,) = {"paper", "other"} - {rivals}
    assert (claim.verdict, claim.flips, claim.verdicts[beside]) == (verdict, True, "refuted")
    count = int(verdict == "supported")
    assert over_gains([claim]).startswith(f"Of the paper's {count} supported sentences 0 hold")
    assert "sets of gains tried" not in claim.beside[beside]
    if verdict == "not shown":
        assert claim.beside[rivals]["sets of gains tried"] == 51


def test_a_search_may_be_over_the_gains_of_another_law_than_the_first(written):
    data = DATA.format(
        over="some",
        limit="> 3",
        plants='["duffing"]',
        margins="",
    )
    data = data.replace(
        'laws = ["classical"]', 'laws = ["none", "classical"]\nsearched = "classical"'
    )
    assert decided(written(data))[0] == "supported"


def test_the_gains_tried_are_halton_s_points_within_the_bounds_then_some_around_the_best(
    written, snapshot
):
    """No run is made: these numbers are the same on every machine."""
    margins = 'c = [0.5, 2.0]\nmargins = "margins"'
    cases = [
        (over, limit, quick)
        for over in ("all", "some")
        for limit in ("< 4", "> 4", "< 1")
        for quick in (False, True)
    ]
    said = []
    for over, limit, quick in cases:
        (claim,) = audit(
            written(
                DATA.format(
                    over=over,
                    limit=limit,
                    plants='["duffing"]',
                    margins=margins,
                )
            ),
            quick=quick,
        ).claims
        numbers = []
        for value in claim.beside["paper"].values():
            numbers.append(f"{value:.9g}")
        said += [f"{over} {limit} {'quick' * quick}: {claim.verdict} {' '.join(numbers)}"]
    assert said == snapshot
