"""The verdicts of full audits, which docs/papers.md shows, are those that the audits give.

    python tests/evidence/papers/test_full_verdicts.py levant_1993

This writes the verdicts of one paper again; without a name, those of all papers but Gaber's. His
audit takes minutes, and no test repeats it: test_quick_verdicts_of_gaber.py tells when it changes.
"""

import json
import re
import sys
from pathlib import Path

import pytest

from smc_mujoco.evidence.audit.audit import audit
from smc_mujoco.evidence.audit.paper import paper, shipped
from smc_mujoco.evidence.audit.verdict import Claim

ROOT = Path(__file__).parents[3]
SHOWN = ROOT / "docs" / "site" / "verdicts.json"
PAPERS = [name for name in shipped() if name != "gaber"]
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]\d+)?")

# claim -> verdict, the check that decides, and whether every set of gains has that verdict
Shown = dict[str, tuple[str, str, bool]]


def known(name: str) -> Shown:
    """Return what the page shows of a paper."""
    return json.loads(SHOWN.read_text(encoding="utf-8"))[name]


def full(name: str) -> Shown:
    """Return what the page is to show of a paper."""
    return {
        claim.id: (claim.verdict, decided(claim), claim.for_every_set)
        for claim in audit(name).claims
    }


def decided(claim: Claim) -> str:
    """Return the check that decides, under the set of gains that has the claim's verdict, the
    hardest of several.
    """
    sets = [name for name, verdict in claim.verdicts.items() if verdict == claim.verdict] or [
        *claim.verdicts
    ]
    checks = {name: check for name in sets if (check := claim.decisive(name))}
    name = min(checks, key=lambda name: (checks[name].holds, checks[name].slack))
    return claim.decided(name) + (f", {name} gains" if len(claim.verdicts) > 1 else "")


@pytest.mark.quick
def test_the_page_shows_every_claim_of_every_paper():
    assert {name: [*known(name)] for name in shipped()} == {
        name: [*paper(name).claims] for name in shipped()
    }


WORDS = {
    "supported": "holds in full",
    "partly supported": "holds in part",
    "refuted": "refuted",
    "not shown": "not shown to hold",
    "not as measured": "cannot be judged",
}


def test_readme_counts_the_claims_of_gaber_s_paper():
    own = []
    for id, claim in paper("gaber").claims.items():
        if claim.whose == "paper":
            own.append(known("gaber")[id][0])
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"The {len(own)} claims of " in text
    counts = [(words, str(own.count(verdict))) for verdict, words in WORDS.items()]
    assert re.findall(r"(?m)^\| ([a-z ]+) \| (\d+) \|$", text) == counts


@pytest.mark.slow
@pytest.mark.parametrize("name", PAPERS)
def test_full_verdicts_are_those_of_the_page(name):
    audited = full(name)
    on_page = known(name)
    assert [*audited] == [*on_page]
    for id, (verdict, words, everywhere) in audited.items():
        reported, said, known_everywhere = on_page[id]
        assert everywhere == known_everywhere
        assert (verdict, NUMBER.split(words)) == (reported, NUMBER.split(said)), id
        numbers = []
        for text in (words, said):
            numbers.append([float(figure) for figure in NUMBER.findall(text)])
        assert numbers[0] == pytest.approx(numbers[1], rel=0.05, abs=1e-8), id


if __name__ == "__main__":
    if SHOWN.exists():
        everything = json.loads(SHOWN.read_text(encoding="utf-8"))
    else:
        everything = {}
    for name in sys.argv[1:] or PAPERS:
        everything[name] = full(name)
        text = json.dumps(dict(sorted(everything.items())), indent=1, ensure_ascii=False)
        SHOWN.write_text(text + "\n", encoding="utf-8")
