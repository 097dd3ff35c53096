"""Mutants of laws: what they are, and that a claim which no mutant loses is found."""

import numpy as np
import pytest
from evidence.helpers.broken_laws import BLIND, KEPT, MUTANTS, survivors

import smc_mujoco as smc
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.control.law import law_function
from smc_mujoco.evidence.audit.paper import new
from smc_mujoco.evidence.audit.variants import variant

DATA = """
title = "t"
authors = "a"
source = "s"
read = "full text"
runs = "duration=0.5"
[[claim]]
id = "1"
whose = "paper"
text = "it settles"
where = "p. 1"
function = "{}"
plants = ["duffing"]
laws = [{}]
holds_if = {{ size = "{}" }}
{}
"""
CODE = """
import numpy as np
def moved(runs):
    (one,) = runs.traces(runs.grid().values())
    return {"size": {"a": float(abs(one.x[-1, 0])), "b": float("nan")}}
def end(runs):
    (one,) = runs.traces(runs.grid().values())
    return {"size": float(abs(one.x[-1, 0]))}
def constant(runs):
    return {"size": 1.0}
def named(runs):
    law = {one.scenario.law.name: one for one in runs.traces(runs.grid().values())}["classical"]
    return {"size": float(law.x.shape[1])}
def swaps(runs):
    (one,) = runs.traces(runs.grid().values())
    rest = float(abs(one.u[:-1]).max())
    return {"size": 1.0 - rest, "other": rest}
def weak(runs):
    (one,) = runs.traces(runs.grid().values())
    size = one.scenario.law.gains["k"] + 0.1 * float(abs(one.x[-1, 0]))
    return {"size": size, "other": size}
def picky(runs):
    (one,) = runs.traces(runs.grid().values())
    if not np.abs(one.u).any():
        raise ValueError("no command")
    return {"size": 1.0}
"""


@pytest.fixture
def paper(tmp_path):
    def write(function: str, asked: str, more: str = "", laws: str = '"classical"'):
        (tmp_path / "paper.toml").write_text(DATA.format(function, laws, asked, more))
        (tmp_path / "claims.py").write_text(CODE)
        return tmp_path

    return write


@law_function(gains={"k": 3.0})
def winding(y, gains, memory):
    """Integrate the error."""
    memory[0] += gains.k * y.e * y.dt
    return -memory[0], y.e


@pytest.mark.quick
def test_mutants_reverse_the_command_drop_it_forget_or_switch():
    scenario = smc.Scenario(plant="duffing", law=winding(), duration=0.05)
    laws = [variant(winding(), name) for name in MUTANTS]
    true, *broken = smc.run(
        [scenario, *(smc.Scenario(plant="duffing", law=law, duration=0.05) for law in laws)]
    )
    wrong, without, forgetful, relay = broken
    assert true.u[0, 0] == -wrong.u[0, 0] < 0.0
    assert not without.u.any()
    assert set(np.unique(relay.u)) == {-6.0}
    ends = [
        smc.Scenario(
            plant="duffing",
            law=laws[-1],
            x0=x,
            v0=0.0,
            duration=0.002,
        )
        for x in (-0.5, 0.0)
    ]
    assert [trace.u[-1, 0] for trace in smc.run(ends)] == [6.0, 0.0]
    x = forgetful.x[:, 0]
    np.testing.assert_allclose(forgetful.u[:, 0], -3.0 * x * 1e-3, rtol=1e-12)
    assert np.abs(true.u[-1, 0]) > 10 * np.abs(forgetful.u[-1, 0])


@pytest.mark.parametrize(
    ("function", "asked", "kept"),
    [
        ("end", "< 1.49", None),
        ("constant", "< 2", KEPT),
        ("constant", "> 2", BLIND),
        ("end", "> 2", None),
        ("moved", "> 2", None),
        ("picky", "< 2", None),
        ("named", "< 2", KEPT),
    ],
)
def test_a_claim_that_no_mutant_loses_is_found(paper, function, asked, kept):
    done = []
    reported = lambda done_now, whole: done.append((done_now, whole))  # noqa: E731
    assert survivors(paper(function, asked), report=reported) == ({"1": kept} if kept else {})
    assert done == [(1, 5), (2, 5), (3, 5), (4, 5)]


def test_a_mutant_that_loses_one_sentence_and_gains_another_loses_the_claim(paper):
    file = paper("swaps", "ASKED") / "paper.toml"
    two = 'size = { asked = "> 0", sentence = "it rests" }'
    two += ', other = { asked = "> 1", sentence = "it acts" }'
    file.write_text(file.read_text().replace('size = "ASKED"', two))
    assert survivors(file.parent) == {}


@pytest.mark.parametrize(
    ("asked", "other", "kept"),
    [
        ("< 2", "< 2", KEPT),
        ("< 4", "> 9", KEPT),
        ("< 1", "> 9", None),
    ],
)
def test_what_holds_under_one_set_of_gains_or_in_one_sentence_is_lost_by_it_not_by_a_number(
    paper, asked, other, kept
):
    file = paper("weak", "ASKED") / "paper.toml"
    two = f'size = {{ asked = "{asked}", sentence = "weak" }}'
    two += f', other = {{ asked = "{other}", sentence = "it acts" }}'
    gains = "[gains.strong]\nclassical = { k = 3.0, c = 1.0 }\n"
    gains += "[gains.weak]\nclassical = { k = 1.0, c = 1.0 }\n"
    file.write_text(file.read_text().replace('size = "ASKED"', two) + gains)
    assert survivors(file.parent, quick=False) == ({"1": kept} if kept else {})


def test_a_claim_that_says_why_is_not_asked(paper):
    assert survivors(paper("constant", "< 2", 'immune = "a number of the paper alone"')) == {}


def test_a_claim_without_a_law_cannot_be_asked(paper):
    with pytest.raises(ScenarioError, match="claim 1 names no law"):
        survivors(paper("constant", "< 2", laws=""))


def test_every_claim_of_the_template_can_be_lost(tmp_path):
    new(tmp_path / "mine")
    assert survivors(tmp_path / "mine") == {}
