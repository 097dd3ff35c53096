"""Papers of other packages are listed, and what is wrong with one is one sentence."""

import pytest
from common.test_other_packages import EXAMPLE, install, said
from helpers.pages import ROOT

import smc_mujoco as smc
from smc_mujoco.evidence.audit import paper

__all__ = ["install"]  # the fixture


@pytest.fixture
def papers_read_again():
    paper.paper_catalogue.cache_clear()
    yield
    paper.paper_catalogue.cache_clear()


@pytest.mark.quick
@pytest.mark.usefixtures("papers_read_again")
def test_a_paper_with_something_wrong_is_left_out_of_the_list(install, tmp_path):
    folder = install(
        "papers",
        {"papers": {"their_paper": "their_papers.their_paper", "no_folder": "no_folder"}},
        no_folder="",
    )
    home = folder / "their_papers" / "their_paper"
    home.mkdir(parents=True)
    (folder / "their_papers" / "__init__.py").touch()
    for file in ("paper.toml", "claims.py"):
        (home / file).write_text((ROOT / "smc_mujoco/evidence/audit/template" / file).read_text())
    (home / "__init__.py").touch()
    first = said(paper.papers)
    assert [sentence.partition(": its")[0] for sentence in first] == ["package 'papers'"]
    assert "no_folder.py is no folder: give a package with paper.toml and claims.py" in first[0]
    assert paper.papers()["their_paper"].name == "their_paper"
    assert paper.paper_catalogue().package("their_paper") == "papers"
    paper._read_once.cache_clear()
    (home / "paper.toml").write_text("title = 3")
    (sentence,) = said(paper.papers)
    assert sentence.startswith("package 'papers': its paper 'their_paper': ")
    assert "their_paper" not in paper.papers()


@pytest.mark.slow
def test_the_paper_of_the_template_is_supported(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLE))
    claims = smc.claims(paper=str(EXAMPLE / "my_smc_package" / "my_paper"))
    assert [claim.verdict for claim in claims] == ["supported", "supported"]
