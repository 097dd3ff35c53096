"""Every paper that ships: its runs are of what its file names, and its claims can be lost.

All claims of all papers take minutes; here are the cheap ones of every paper. The others are asked by
`smc-mujoco claims --paper NAME --quick --mutants`.
"""

import pytest

from smc_mujoco.evidence.audit.audit import audit
from smc_mujoco.evidence.audit.mutants import survivors
from smc_mujoco.evidence.audit.paper import paper, shipped

CHEAP = {  # paper -> claims that take a few s at most; all of a paper that is not here
    "aldana_lopez_2019": ["1"],
    "gaber": ["13", "29", "45", "49", "50"],
    "huber_2014": ["1", "2"],
    "levant_1993": ["5"],
    "levant_2003": ["5", "6"],
    "obeid_2018": ["7"],
    "perez_ventura_2017": ["1"],
    "seeber_2020": ["1"],
    "shtessel_2012": ["1"],
}
VARIANTS = ("_reversed", "_squeezed", "_zero", "_relay", "_forgetful")


@pytest.mark.parametrize("name", shipped())
def test_every_claim_says_what_where_how_and_whose(name):
    about = paper(name)
    assert all((about.title, about.authors, about.source, about.read))
    for one in about.claims.values():
        assert all((one.text, one.where, one.measured, one.holds_if, one.laws, one.whose, one.read)), one.id
        assert one.whose == "paper" or one.how, one.id
        assert one.plants or one.varies, one.id


@pytest.mark.parametrize("name", shipped())
def test_runs_are_of_the_plants_and_laws_that_the_claim_names(name):
    about = paper(name)
    for id, sets in audit(name, CHEAP.get(name), quick=True).used.items():
        entry = about.claims[id]
        plants = {about.plant(one).name for one in entry.plants}
        laws = {*entry.laws, *(law + variant for law in entry.laws for variant in VARIANTS)}
        for one in (one for runs in sets.values() for one in runs.values()):
            assert one.scenario.plant.name in plants, id
            assert one.scenario.law.name in laws, id


def test_mutants_of_its_law_lose_each_cheap_claim_of_the_first_paper():
    assert survivors("gaber", CHEAP["gaber"]) == {}
