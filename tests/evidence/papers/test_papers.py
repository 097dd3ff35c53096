"""Every paper that ships: what its file says of each claim, and that cheap claims can be lost.

Mutants of all claims take minutes: `smc-mujoco claims --paper NAME --quick --mutants`.
"""

import pytest
from evidence.helpers.broken_laws import survivors

from smc_mujoco.evidence.audit.paper import paper, shipped


@pytest.mark.quick
@pytest.mark.parametrize("name", shipped())
def test_every_claim_says_what_where_how_and_whose(name):
    about = paper(name)
    assert all((about.title, about.authors, about.source, about.read))
    for claim in about.claims.values():
        assert all(
            (
                claim.text,
                claim.where,
                claim.measured,
                claim.holds_if,
                claim.laws,
                claim.whose,
                claim.read,
            )
        ), claim.id
        assert claim.evidence.__doc__, claim.id
        assert claim.whose == "paper" or claim.how, claim.id
        assert claim.plants or claim.varies, claim.id


@pytest.mark.slow
def test_mutants_of_its_law_lose_each_cheap_claim_of_the_first_paper():
    assert survivors("gaber", ["13", "29", "45", "49", "50"]) == {}
