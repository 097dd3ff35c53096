"""The colours of laws are told apart, by every eye: measured, not looked at."""

import itertools
import random

import numpy as np
import pytest
from matplotlib.colors import to_hex

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.analysis.tuning.search import tune
from smc_mujoco.control.law import catalogue
from smc_mujoco.draw import figure, style
from smc_mujoco.draw.pareto import MARKS, pareto

pytestmark = pytest.mark.quick

STATED = {template.colour: template.name for template in catalogue().values() if template.colour}
SEEN = {  # linear sRGB as it looks to whom: G. M. Machado et al., IEEE TVCG 15(6), 2009, severity 1
    "all cones": np.eye(3),
    "no red": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "no green": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "no blue": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
# Steps of L, a and b of CIELAB that half of all observers notice in marks of a third of a degree, which is 3.5 mm from
# 60 cm. Source: M. Stone, D. Szafir and V. Setlur, "An engineering model for color difference as a function of size",
# Color and Imaging Conference 2014; these are the smallest marks of that study.
NOTICEABLE = 0.5 * (np.array([10.16, 10.68, 10.70]) + 3.0 * np.array([1.50, 3.08, 5.74]))
# What fails: pairs of stated colours that half of all observers do not tell apart. Lines are thinner than such marks.
MISTAKEN_STATED = {"no green": {("conditioned_super_twisting", "observer_free")}}
XYZ = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.072175], [0.0193339, 0.119192, 0.9503041]])


def lab(colour: str, eye: str) -> np.ndarray:
    """CIELAB (D65) of a colour."""
    c = np.array(style.rgb(colour)) / 255
    linear = np.clip(SEEN[eye] @ np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4), 0.0, 1.0)
    t = XYZ @ linear / XYZ.sum(axis=1)
    x, y, z = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def mistaken(one: str, other: str, eye: str) -> bool:
    """Whether half of all observers see no difference between two colours, in any of L, a and b."""
    return bool((np.abs(lab(one, eye) - lab(other, eye)) < NOTICEABLE).all())


@pytest.mark.parametrize("eye", SEEN)
def test_the_colours_of_laws_are_apart_and_apart_from_all_else_that_is_drawn(eye):
    drawn = [style.REACTION, style.DISTURBANCE, style.FAILED, style.PAPER]
    assert not [pair for pair in itertools.product(STATED, drawn) if mistaken(*pair, eye)]
    pairs = {(STATED[a], STATED[b]) for a, b in itertools.permutations(STATED, 2) if mistaken(a, b, eye)}
    assert {pair for pair in pairs if pair[0] < pair[1]} == MISTAKEN_STATED.get(eye, set())


def test_a_law_has_one_colour_in_every_picture():
    laws = sorted(smc.laws())
    for few in (laws, laws[::-1], *itertools.combinations(laws, 2)):
        assert style.law_colours(few) == [style.law_colour(law) for law in few]


def test_laws_are_mistaken_for_each_other_less_than_half_as_often_as_with_colours_at_random():
    """Five pairs of 49 laws are. Colours of the same lightness and strength, drawn at random, have about 20."""
    laws = smc.laws()
    drawn = random.Random(0).choices(style._grid(0), k=len(laws))
    pairs, chance = (
        sum(mistaken(*pair, "all cones") for pair in itertools.combinations(colours, 2))
        for colours in ([style.law_colour(law) for law in laws], drawn)
    )
    assert 2 * pairs < chance


def test_laws_that_would_be_mistaken_for_each_other_differ_in_one_picture():
    mine = [f"law_{k}" for k in range(300)]
    apart = [law for law in mine if style.distance(style.law_colour(law), "#0072B2") > 2 * style.MIN_DISTANCE]
    same = [law for law in apart if style.law_colour(law) == style.law_colour(apart[0])][:2]
    given = style.law_colours([*same, "observer_free", "observer_free"])
    assert [given[0], given[2]] == [style.law_colour(same[0]), "#0072B2"]
    assert min(style.distance(*pair) for pair in itertools.combinations(given, 2)) > style.MIN_DISTANCE
    several = style.law_colours(mine[:8])  # twice as far, as their places in the palette say nothing
    assert min(style.distance(*pair) for pair in itertools.combinations(several, 2)) > 2 * style.MIN_DISTANCE
    green = style.law_colour("super_twisting")
    for law in mine:  # the library's law keeps its colour, whichever comes first
        first, second = style.law_colours([law, "super_twisting"])
        assert second == green
        assert style.distance(first, second) > 2 * style.MIN_DISTANCE


def test_law_colours_never_repeat_in_one_picture():
    names = [f"law_{k}" for k in range(100)]
    assert len({*style.law_colours([*smc.laws(), *names])}) == len(smc.laws()) + len(names)


@pytest.mark.filterwarnings("ignore:no set of gains tried")
def test_laws_that_would_share_a_colour_differ_in_signals_and_fronts_too(monkeypatch):
    monkeypatch.setattr(style, "law_colour", lambda law: "#0072B2")
    laws = ("observer_free", "classical")
    runs = smc.run([smc.Scenario(plant="duffing", law=law, duration=0.05) for law in laws])
    rows = figure.figure(runs, None, ["b", "b"], panels=["u"])
    brief = Objective(conditions=("nominal",), duration=0.1)
    fronts = pareto([tune("duffing", law, budget=4, objective=brief, searches=1) for law in laws])
    assert len({to_hex(line.get_color()) for ax in rows.axes for line in ax.lines}) == 2
    (ax,) = fronts.axes
    assert len({to_hex(line.get_color()) for line in ax.lines if str(line.get_marker()) in MARKS}) == 2


def test_labels_tell_runs_of_one_law_apart_by_the_parameters_of_their_plants():
    runs = [smc.Scenario(plant=smc.plant("duffing", delta=delta), law="pid", duration=0.01) for delta in (0.2, 0.5)]
    labels = style.labels(smc.run(runs), None)
    assert labels == ["PID: delta = 0.2", "PID: delta = 0.5"]
    assert style.distinct(labels) == ["delta = 0.2", "delta = 0.5"]
    heavy = smc.Scenario(plant="duffing", law="classical", mismatch={"mass": 1.3}, duration=0.01)
    assert style.labels(smc.run([runs[0], heavy]), None) == ["PID: M = 1", "Classical: M = 1.3"]
    assert style.distinct(["PID: k = 1", "LQR"]) == ["PID: k = 1", "LQR"]


@pytest.mark.parametrize(
    ("colour", "lab"),
    [("#FFFFFF", (1.0, 0.0, 0.0)), ("#FF0000", (0.62796, 0.22486, 0.12585)), ("#00FF00", (0.86644, -0.23389, 0.1795)),
     ("#0000FF", (0.45201, -0.03246, -0.31153)), ("#808080", (0.59987, 0.0, 0.0))],
)  # fmt: skip
def test_places_of_colours_are_those_of_oklab(colour, lab):
    """Of B. Ottosson's own conversion; chroma is dampened to 0.12, and lightness counts a third."""
    lightness, a, b = lab
    damp = min(1.0, 0.12 / max(np.hypot(a, b), 1e-9))
    assert style._place(colour) == pytest.approx((lightness / 3.0, damp * a, damp * b), abs=2e-4)


def test_contrasts_are_those_of_wcag():
    """Black on white is 21 : 1. Grey #757575 is the lightest on which white letters have 4.5 : 1."""
    light, grey, black = (style._luminance(colour) + 0.05 for colour in ("#FFFFFF", "#757575", "#000000"))
    assert light / black == pytest.approx(21.0)
    assert 4.5 < light / grey < 4.7
    assert (style.letters_on("#757575"), style.letters_on("#FFE000")) == (style.PAPER, style.INK)
    assert style.lighter("#006400") == "#599A59"  # 35 % white


@pytest.mark.parametrize(
    ("value", "text"), [(0.25, "0.25"), (6.0, "6"), (276.0, "280"), (99_999.0, "100000"), (2e6, "2e+06"), (0.0, "0")]
)
def test_short_numbers(value, text):
    assert style.short(value) == text
