"""Where gains come from: set where they are chosen, kept with the law, and never left on gains that
were replaced.
"""

import copy
import dataclasses
import pickle

import pytest

import smc_mujoco as smc
from smc_mujoco.control import gain_sets, source
from smc_mujoco.control.component import by_channel
from smc_mujoco.control.law import law_function

pytestmark = pytest.mark.quick

PLANT = "inverted_pendulum"
LAW = "super_twisting"


@law_function(gains={"k": 2.0})
def my_law(y, gains, memory):
    return -gains.k * y.e, y.e


def sets(name=LAW):
    """The same law with gains of each source."""
    return {
        "default": smc.law(name),
        "shipped": gain_sets.law_with_gains(PLANT, name, "tuned"),
        "study": gain_sets.law_with_gains(PLANT, name, "study"),
        "given": smc.law(name, k1=2.0),
    }


def test_a_law_is_the_users_only_with_gains_of_the_user():
    assert [
        law.source.kind for law in (my_law(), my_law(k=2.0), smc.law("pid"), smc.law("pid", kp=9.0))
    ] == [
        "default",
        "given",
        "default",
        "given",
    ]
    assert smc.Scenario(plant=PLANT, law=my_law).law.source.kind == "default"
    assert smc.law("none").source.kind == "none"
    assert smc.law("none").named("idle").source.kind == "none"
    assert gain_sets.law_with_gains(PLANT, LAW, "default").source.kind == "default"


@pytest.mark.parametrize("kind", sets())
def test_copies_keep_the_source(kind, tmp_path):
    law = sets()[kind]
    source = law.source
    copies = [
        pickle.loads(pickle.dumps(law)),
        pickle.loads(pickle.dumps(law.named("other"))),
        copy.deepcopy(law),
        dataclasses.replace(law, memory=9),
        dataclasses.replace(law, gains=dict(law.gains)),
        by_channel([law, law]),
        by_channel([law, smc.law("none").named("x")]).of_channel(0),
    ]
    trace = smc.run(
        smc.Scenario(
            plant=PLANT,
            law=law,
            duration=0.01,
        )
    )
    copies.append(smc.load(trace.save(tmp_path / "trace.npz")).scenario.law)
    assert [copied.source for copied in copies] == [source] * len(copies)


@law_function(gains={"k": 2.0, "c": 1.0}, conditions={"c < k": lambda g: g.c < g.k})
def bounded(y, gains, memory):
    return -gains.k * y.e - gains.c * y.de, y.e


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    "law", [bounded, smc.law("twisting").template, smc.law("terminal").template]
)
def test_gains_outside_the_theorem_are_marked_wherever_their_source_is_told(law, tmp_path):
    outside = {"bounded": {"k": 0.5}, "twisting": {"r1": 0.5}, "terminal": {"p": 0.3}}[law.name]
    beyond = law(**outside)
    name = next(iter(outside))
    assert "outside" not in str(law().source) + str(law(**law.defaults).source)
    trace = smc.run(smc.Scenario(plant=PLANT, law=beyond, duration=0.01))
    alike = [
        pickle.loads(pickle.dumps(beyond)),
        beyond.named("other"),
        dataclasses.replace(law(), gains=beyond.gains),
        law(**{name: (law.defaults[name], outside[name])}),
        by_channel([law(), beyond]),
        by_channel([beyond, smc.law("pid")]),
        beyond.on_computed_torque(),
        smc.load(trace.save(tmp_path / "trace.npz")).scenario.law,
    ]
    for marked_law in alike:
        assert "outside its theorem" in str(marked_law.source), marked_law
    assert "outside" not in str(by_channel([law(), beyond]).of_channel(0).source)


def test_replaced_gains_are_the_users():
    for law in sets().values():
        changed = dataclasses.replace(law, gains={**law.gains, "k1": 7.5})
        assert changed.source.kind == "given"
        assert changed.source.search is None


def test_gains_by_channel_are_of_their_common_source():
    default = smc.law("pid")
    shipped = gain_sets.law_with_gains("duffing", "pid")
    of_channels = by_channel(
        [
            shipped,
            dataclasses.replace(
                shipped, gains=default.gains, source=shipped.source.with_gains(default.gains)
            ),
        ]
    )
    assert of_channels.source.kind == of_channels.of_channel(1).source.kind == "shipped"
    assert by_channel([default, shipped]).source.kind == "given"
    assert by_channel([smc.law("classical"), default]).source.kind == "default"


def test_laws_with_equal_gains_are_equal():
    default = smc.law("classical")
    same = smc.law("classical", **default.gains)
    assert (default == same, hash(default) == hash(same)) == (True, True)
    assert default.source != same.source


def test_the_gains_of_one_law_are_told_with_their_search_and_of_several_by_their_kind():
    search = source.GainSearch(
        rule="CMA-ES",
        evaluations=90,
        searches=3,
        spread=0.03,
    )
    shipped = [smc.law("pid").sourced("shipped", search).source]
    assert source.in_words({"a": shipped}) == (
        "gains: shipped (CMA-ES, 90 evaluations, 3 searches, whose final J values differ by up to 3 %)"
    )
    further = {
        "a": shipped,
        "b": [smc.law("pid").source],
        "c": [smc.law("none").source],
    }
    assert source.in_words(further) == "gains: shipped for a, default for b"


def test_files_in_which_given_gains_were_called_yours_can_still_be_read():
    assert source.restored_source({"kind": "yours", "search": None}).kind == "given"
