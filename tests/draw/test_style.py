"""The colours of laws are told apart, by every eye: measured, not looked at."""

import itertools

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

STATED = [template.colour for template in catalogue().values() if template.colour]
SEEN = {  # linear sRGB as it looks to whom: G. M. Machado et al., IEEE TVCG 15(6), 2009, severity 1
    "all cones": np.eye(3),
    "no red": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "no green": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "no blue": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
APART = {"all cones": 15.0, "no red": 5.5, "no green": 5.5, "no blue": 5.5}  # of colours that laws state
XYZ = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.072175], [0.0193339, 0.119192, 0.9503041]])


def lab(colour: str, eye: str) -> np.ndarray:
    """CIELAB (D65) of a colour."""
    c = np.array(style.rgb(colour)) / 255
    linear = np.clip(SEEN[eye] @ np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4), 0.0, 1.0)
    t = XYZ @ linear / XYZ.sum(axis=1)
    x, y, z = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def ciede2000(one: np.ndarray, other: np.ndarray) -> float:
    """G. Sharma, W. Wu, E. N. Dalal, Color Research & Application 30(1), 2005, equations 2 to 22."""
    (l1, a1, b1), (l2, a2, b2) = one, other
    mean = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2
    stretch = 1.5 - 0.5 * np.sqrt(mean**7 / (mean**7 + 25**7))
    c1, c2 = np.hypot(a1 * stretch, b1), np.hypot(a2 * stretch, b2)
    h1, h2 = (np.degrees(np.arctan2(b, a * stretch)) % 360 for a, b in ((a1, b1), (a2, b2)))
    turn = (h2 - h1 + 180) % 360 - 180
    light, chroma, hue = (l1 + l2) / 2, (c1 + c2) / 2, (h1 + turn / 2) % 360
    weights = ((1, 0, 0), (-0.17, 1, -30), (0.24, 2, 0), (0.32, 3, 6), (-0.2, 4, -63))
    t = sum(w * np.cos(np.radians(k * hue + shift)) for w, k, shift in weights)
    of_l = (l2 - l1) / (1 + 0.015 * (light - 50) ** 2 / np.sqrt(20 + (light - 50) ** 2))
    of_c = (c2 - c1) / (1 + 0.045 * chroma)
    of_h = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(turn / 2)) / (1 + 0.015 * chroma * t)
    twist = np.sin(np.radians(60 * np.exp(-(((hue - 275) / 25) ** 2)))) * 2 * np.sqrt(chroma**7 / (chroma**7 + 25**7))
    return float(np.sqrt(of_l**2 + of_c**2 + of_h**2 - twist * of_c * of_h))


@pytest.mark.parametrize(
    ("one", "other", "distance"),  # of the paper's table 1: pairs 1, 9, 16, 17, 22, 25
    [
        ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
        ((50.0, 2.49, -0.001), (50.0, -2.49, 0.0009), 7.1792),
        ((50.0, 2.5, 0.0), (50.0, 0.0, -2.5), 4.3065),
        ((50.0, 2.5, 0.0), (73.0, 25.0, -18.0), 27.1492),
        ((50.0, 2.5, 0.0), (50.0, 3.2592, 0.335), 1.0),
        ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
    ],
)
def test_the_distance_is_that_of_the_paper(one, other, distance):
    assert ciede2000(np.array(one), np.array(other)) == pytest.approx(distance, abs=1e-4)


@pytest.mark.parametrize("eye", SEEN)
def test_the_colours_of_laws_are_apart_and_apart_from_all_else_that_is_drawn(eye):
    drawn = [style.REACTION, style.DISTURBANCE, style.FAILED, style.PAPER]
    pairs = [*itertools.product(STATED, drawn), *itertools.combinations(STATED, 2)]
    close = {pair: ciede2000(*(lab(colour, eye) for colour in pair)) for pair in pairs}
    assert min(close.values()) > APART[eye], min(close, key=close.__getitem__)


def test_a_law_has_one_colour_in_every_picture():
    laws = smc.laws()
    colours = [lab(style.law_colour(law), "all cones") for law in laws]
    assert min(itertools.starmap(ciede2000, itertools.combinations(colours, 2))) > 5.0
    for few in (laws, laws[::-1], *itertools.combinations(laws, 2)):
        assert style.law_colours(few) == [style.law_colour(law) for law in few]


def test_laws_that_would_be_mistaken_for_each_other_differ_in_one_picture():
    mine = [f"law_{k}" for k in range(300)]
    same = [law for law in mine if style.law_colour(law) == style.law_colour(mine[0])][:2]
    given = style.law_colours([*same, "observer_free", "observer_free"])
    assert [given[0], given[2]] == [style.law_colour(same[0]), "#0072B2"]
    assert min(style.distance(*pair) for pair in itertools.combinations(given, 2)) > 0.1


def test_law_colours_never_repeat_in_one_picture():
    names = [f"law_{k}" for k in range(300)]
    assert len({*style.law_colours([*smc.laws(), *names])}) == len(smc.laws()) + len(names)


@pytest.mark.filterwarnings("ignore:no set of gains tried")
def test_laws_that_would_share_a_colour_differ_in_signals_and_fronts_too(monkeypatch):
    monkeypatch.setattr(style, "law_colour", lambda law: "#0072B2")
    laws = ("observer_free", "classical")
    runs = smc.run([smc.Scenario(plant="duffing", law=law, duration=0.05) for law in laws])
    rows = figure.signals(runs, None, ["b", "b"])
    brief = Objective(conditions=("nominal",), duration=0.1)
    fronts = pareto([tune("duffing", law, budget=4, objective=brief) for law in laws])
    assert len({to_hex(ax.lines[0].get_color()) for ax in rows.axes}) == 2
    (ax,) = fronts.axes
    assert len({to_hex(line.get_color()) for line in ax.lines if str(line.get_marker()) in MARKS}) == 2


def test_labels_tell_runs_of_one_law_apart_by_the_parameters_of_their_plants():
    runs = [smc.Scenario(plant=smc.plant("duffing", delta=delta), law="pid", duration=0.01) for delta in (0.2, 0.5)]
    labels = style.labels(smc.run(runs), None)
    assert labels == ["PID: delta = 0.2", "PID: delta = 0.5"]
    assert style.distinct(labels) == ["delta = 0.2", "delta = 0.5"]
    assert style.distinct(["PID: k = 1", "LQR"]) == ["PID: k = 1", "LQR"]
