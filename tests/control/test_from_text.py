"""Laws as text: names, gains in brackets, and files, at every door that takes a law."""

import copy
from pathlib import Path

import pytest

import smc_mujoco as smc
from smc_mujoco.common.files import sealed, write_json
from smc_mujoco.control import surface
from smc_mujoco.control.from_text import component, parsed_gains
from smc_mujoco.simulation import scenario_json

MINE = """
import smc_mujoco as smc
from smc_mujoco.control.units import RATE, Gain

@smc.law_function(gains={"k": Gain(2.0, RATE), "c": Gain(1.0, RATE)})
def mine(y, gains, memory):
    s = y.de + gains.c * y.e
    return -gains.k * s, s
"""

FROM_ELSEWHERE = """
import smc_mujoco as smc

usual = smc.law("pid")
law = its = smc.law_function(lambda y, gains, memory: (-2.0 * y.e, y.e))().named("theirs")
"""

TUNED = {
    "source": None,
    "law": {"name": "mine", "module": "mine", "gains": {"k": 7.0, "c": 1.5}}
    | {"memory": 0, "degree": 1},
    "plant": {"name": "duffing", "module": "smc_mujoco.mechanisms.plants.duffing"},
}


def write_tuning(path, scenario):
    """Write what counts of a tuning."""
    write_json(Path(path), sealed({"scenario": scenario}))


@pytest.fixture
def files(tmp_path, monkeypatch):
    """Files of laws, in the working folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(MINE)
    (tmp_path / "theirs.py").write_text(FROM_ELSEWHERE)
    (tmp_path / "bound.py").write_text(MINE + "law = mine(k=3.0)\n")
    (tmp_path / "two.py").write_text(MINE + MINE.replace("mine", "other"))
    (tmp_path / "notes.txt").write_text("pid")
    write_tuning(tmp_path / "mine.json", TUNED)
    (tmp_path / "empty.json").write_text("{}")
    return tmp_path


@pytest.fixture(scope="module")
def tuned():
    return smc.tune(
        "duffing",
        smc.law("boundary_layer", k=0.01),
        budget=4,
        searches=1,
    )


@pytest.mark.quick
@pytest.mark.parametrize(
    ("text", "name", "gains"),
    [
        ("twisting", "twisting", {}),
        ("twisting(r1=5, r2=2e0)", "twisting", {"r1": 5.0, "r2": 2.0}),
        ("slow: twisting(r1=5)", "slow", {"r1": 5.0}),
        ("twisting(r1=(5, 6))", "twisting", {"r1": (5.0, 6.0)}),
        ("mine.py", "mine", {"k": 2.0}),
        ("bound.py", "mine", {"k": 2.0}),
        ("theirs.py", "theirs", {}),
        ("./mine.py(k=4)", "mine", {"k": 4.0, "c": 1.0}),
        ("fast: mine.py(k=4)", "fast", {"k": 4.0}),
        ("mine.py(mine.json)", "mine", {"k": 7.0}),
    ],
)
def test_a_text_is_its_law(files, text, name, gains):
    law = smc.law(text)
    assert law.name == name
    assert {gain: law.gains[gain] for gain in gains} == gains
    assert law.source.kind == ("given" if "(" in text else "default" if law.gains else "none")


SHIPPED = scenario_json.describe(
    smc.Scenario(plant="duffing", law=smc.law("pid", plant="duffing"), duration=0.1)
)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda data: data["law"]["gains"].pop("kd"),
            "the file lacks kd, and 'pid' has the gains kp",
        ),
        (lambda data: data["plant"].update(name="duffin"), "unknown plant of .*did you mean"),
    ],
)
def test_a_tuning_that_lost_something_is_refused(files, change, words):
    write_tuning("good.json", SHIPPED)
    assert smc.law("good.json").source.kind == "shipped"
    data = copy.deepcopy(SHIPPED)
    change(data)
    write_tuning("bad.json", data)
    with pytest.raises(smc.ScenarioError, match=words):
        smc.law("bad.json")


def test_a_tuning_of_another_law_is_refused(files):
    Path("other.py").write_text(MINE.replace("mine", "other"))
    with pytest.raises(smc.ScenarioError, match="gains of law 'mine', and other"):
        smc.law("other.py(mine.json)")
    less = copy.deepcopy(TUNED)
    less["law"]["gains"] = {"q": 7.0, "c": 1.5}
    write_tuning("less.json", less)
    with pytest.raises(smc.ScenarioError, match="lacks k"):
        smc.law("mine.py(less.json)")


@pytest.mark.parametrize(
    ("written", "typed", "why"),
    [
        ('"k": 7.0', '"k": -7.0', "was changed, since it was written"),
        ('"k": 7.0', '"k": 7.0, "k": 5.0', "'k' stands in it twice"),
        ('"seal"', '"sealed"', "was changed, since it was written"),
    ],
)
def test_a_tuning_in_which_somebody_wrote_is_refused(files, written, typed, why):
    text = Path("mine.json").read_text()
    assert text.count(written) == 1
    Path("mine.json").write_text(text.replace(written, typed))
    with pytest.raises(smc.ScenarioError, match=rf"mine\.json .*{why}"):
        smc.law("mine.py(mine.json)")


@pytest.mark.slow
def test_a_tuning_is_its_law_and_keeps_its_source(files, tuned):
    tuned.save("st.json")
    law = smc.law("st.json")
    assert law == tuned.law
    assert law.source == tuned.law.source
    assert law.source.kind == "tuned here"
    assert (
        smc.law("st.json", c=9.0).gains
        == smc.law(tuned.law, c=9.0).gains
        == {**tuned.law.gains, "c": 9.0}
    )
    assert smc.law(tuned.law.template, c=9.0) == tuned.law.template(c=9.0)
    assert {s.law for s in smc.grid("duffing", ["st.json"], seeds=2)} == {tuned.law}


TEXTS = (
    "twistin",
    "twisting(5)",
    "twisting(r1=5",
    "twisting(r1=__import__('os'))",
    "twisting(r9=5)",
    "twisting(**1)",
    "twisting(r1=5, r1=6)",
    "twisting(r1=nan)",
    "none.py",
)
TEXTS += ("two.py", "mine.json", "notes.txt", "empty.json", "bare.py", ".", "\0", 3)
# what a sentence names in place of the text: the argument, or the law in a file
NAMED = {
    "twisting(r9=5)": "'r9'",
    "twisting(r1=nan)": "r1 is nan",
    "mine.json": "law mine of mine.json",
}
NAMED |= {"\0": r"'\x00'"}
GAINS = ("lam", "lam=", "3=4", "lam=x", "lam=1_0", "a=1,a=2")


def test_other_texts_are_one_sentence(files, refused):
    (files / "bare.py").write_text("k = 1\n")
    for text in TEXTS:
        refused(lambda text=text: smc.law(text), NAMED.get(text, text))
    for text in GAINS:
        refused(lambda text=text: parsed_gains(text, "--set"), f"--set is {text!r}")
    with pytest.warns(smc.errors.GainWarning, match="1/2 < p < 1"):
        component("surface", "terminal(p=2)", surface.surface_catalogue(), "terminal(b=2)")
    assert parsed_gains(" lam=6, k1=3 5,", "--set") == {"lam": 6.0, "k1": (3.0, 5.0)}
