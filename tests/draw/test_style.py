"""The colours of laws are told apart, by every eye: measured, not looked at."""

import colorsys
import dataclasses
import itertools
import random

import matplotlib.pyplot as plt
import pytest
from helpers.runs import at_defaults
from helpers.sketch import made

import smc_mujoco as smc
from smc_mujoco.control.gain_sets import COMPARED, LAWS
from smc_mujoco.draw import colouring, dark, style, wording

pytestmark = pytest.mark.quick


def least(colours, others=()) -> float:
    """The least distance of two colours in four sights, or of one of them to one of `others`."""
    if others:
        pairs = itertools.product(colours, others)
    else:
        pairs = itertools.combinations(colours, 2)
    return min(colouring.distance(*pair) for pair in pairs)


@pytest.mark.parametrize(
    ("colour", "lab"),
    [
        ("#FFFFFF", (100.0, 0.0, 0.0)),
        ("#FF0000", (53.24, 80.09, 67.20)),
        ("#0000FF", (32.30, 79.20, -107.86)),
    ],
)
def test_colours_are_measured_in_cielab_as_published(colour, lab):
    """B. Lindbloom, for D65. Who sees no red takes red and dark yellow for each other."""
    assert colouring._as_each_sight(colour)[0] == pytest.approx(lab, abs=0.05)
    assert (
        colouring.distance("#FF0000", "#6E5E00") < 20.0 < colouring.distance("#FF0000", "#0000FF")
    )


def test_laws_that_are_compared_by_default_are_apart_in_four_sights():
    colours = colouring.law_colours(LAWS)
    assert colours == [colouring.law_colour(law) for law in LAWS]
    assert least(colours) > 15.0
    assert least(colours, [style.REACTION, style.DISTURBANCE, style.PAPER, style.INK]) > 15.0
    assert least(colours, [style.FAILED]) > 8.0, "the boundary layer's pink, seen without green"


@pytest.mark.parametrize(
    ("count", "reached"),
    [
        (12, 13.7),
        (24, 9.5),
    ],
)
def test_laws_of_one_picture_are_apart_in_four_sights_as_far_as_so_many_can_be(count, reached):
    for k in range(3):
        laws = random.Random(k).sample(sorted(smc.laws()), count)
        assert least(colouring.law_colours(laws)) > reached


def test_laws_of_a_dot_plot_that_share_a_mark_have_colours_that_nobody_mistakes():
    """Dark purple and dark brown pluses, 14.6 apart, were two of the sixteen that are compared by
    default.
    """
    colours = colouring.law_colours(COMPARED)
    shared = []
    for k in range(len(COMPARED) - len(style.MARKS)):
        shared.append([k, k + len(style.MARKS)])
    assert len(set(style.MARKS)) == len(style.MARKS) >= len(COMPARED) / 2
    assert min(least([colours[k] for k in pair]) for pair in shared) > 2 * colouring.MIN_DISTANCE


def test_a_law_has_one_colour_in_every_picture_unless_it_would_be_mistaken():
    laws = sorted(smc.laws())
    unchanged = 0
    for pair in itertools.combinations(laws, 2):
        own_colours = [colouring.law_colour(law) for law in pair]
        pair_colours = colouring.law_colours(pair)
        assert pair_colours[0] == own_colours[0] or pair_colours[1] == own_colours[1]
        assert colouring.law_colours(pair[::-1]) == pair_colours[::-1]
        assert (pair_colours == own_colours) == (
            colouring.distance(*own_colours) >= colouring.MIN_DISTANCE
        )
        unchanged += pair_colours == own_colours
    assert unchanged > 0.84 * len(laws) * (len(laws) - 1) / 2


def test_a_users_laws_take_other_colours_than_the_librarys_which_keep_theirs():
    mine = [f"law_{k}" for k in range(300)]
    green = colouring.law_colour("super_twisting")
    for law in mine:  # whichever comes first
        first, second = colouring.law_colours([law, "super_twisting"])
        assert second == green
        assert colouring.distance(first, second) > colouring.MIN_DISTANCE
    assert least(colouring.law_colours(mine[:8])) > colouring.MIN_DISTANCE


def test_runs_of_one_law_beside_others_have_shades_of_its_colour_and_dashes_tell_them_apart():
    """Friction of 0, 0.005 and 0.02 was magenta, brown and green, then five reds."""
    runs = []
    for law in ("classical", "pid", "classical", "adaptive", "classical"):
        runs.append(made(smc.Scenario(plant="duffing", law=at_defaults(law), duration=0.1)))
    colours = colouring.trace_colours(runs)
    assert colours[1] == colouring.law_colour("pid")
    assert colours[3] == colouring.law_colour("adaptive")
    shades = colours[::2]
    hues = [colorsys.rgb_to_hls(*style.rgb(shade))[0] for shade in shades]
    (own, *_) = colorsys.rgb_to_hls(*style.rgb(colouring.law_colour("classical")))
    assert hues == pytest.approx([own] * 3, abs=0.01)
    light = [style.luminance(shade) for shade in shades]
    assert light == sorted(light, reverse=True)
    assert 1.05 / (light[0] + 0.05) > 3.0, "contrast to paper"
    assert least([*shades, style.FAILED]) > colouring.MIN_DISTANCE
    looks = style.looks(runs)
    assert len({str(look["ls"]) for look in looks}) == len(runs)


def test_runs_that_are_all_of_one_law_have_a_hue_each_the_same_on_light_and_dark_pages():
    """Four designs of one law were four shades of one blue, with heaps of marks where they agreed;
    and two sets of its gains were other colours on a dark page.
    """
    runs = []
    for k in range(8):
        law = smc.law("pid", kp=1.0 + k)
        runs.append(made(smc.Scenario(plant="duffing", law=law, duration=0.1)))
    colours = colouring.trace_colours(runs)
    assert colouring.trace_colours(runs[:4]) == colours[:4]
    assert least(colours) > colouring.MIN_DISTANCE
    with plt.style.context("dark_background"):
        assert colouring.trace_colours(runs) == colours
        neutral = style.neutral_on_dark()
        for colour in colours:
            hues = []
            for shade in (colour, dark.on_dark(colour, neutral)):
                hues.append(colorsys.rgb_to_hls(*style.rgb(shade))[0])
            assert hues[1] == pytest.approx(hues[0], abs=0.01)
    (alone,) = colouring.trace_colours(runs[:1])
    assert alone == colouring.law_colour("pid")


def test_a_title_that_names_the_condition_does_not_repeat_it():
    assert wording.under("An arm and a Wall", "wall") == "An arm and a Wall"
    assert wording.under("Walled in", "wall") == "Walled in, wall"


def test_law_colours_never_repeat_in_one_picture():
    names = [f"law_{k}" for k in range(100)]
    assert len({*colouring.law_colours([*smc.laws(), *names])}) == len(smc.laws()) + len(names)


def test_labels_tell_runs_of_one_law_apart_by_the_parameters_of_their_plants():
    runs = []
    for delta in (0.2, 0.5):
        runs.append(
            smc.Scenario(plant=smc.plant("duffing", delta=delta), law=smc.law("pid"), duration=0.01)
        )
    labels = wording.run_names(smc.run(runs), None)
    assert labels == ["PID: delta = 0.2", "PID: delta = 0.5"]
    assert wording.distinct(labels) == ["delta = 0.2", "delta = 0.5"]
    heavy = smc.Scenario(
        plant="duffing",
        law=smc.law("classical"),
        mismatch={"mass": 1.3},
        duration=0.01,
    )
    assert wording.run_names(smc.run([runs[0], heavy]), None) == [
        "PID: M = 1",
        "Classical: M = 1.3",
    ]
    assert wording.distinct(["PID: k = 1", "LQR"]) == ["PID: k = 1", "LQR"]


def test_a_label_leaves_out_the_last_items_of_a_long_field():
    """With all of them, the machines of a small still have little room."""
    plain = smc.Scenario(plant="duffing", law="pid", duration=0.01)
    late = smc.signals.TimeSeries((0.0, 2.0, 2.5, 5.0), (0.0, 0.0, 0.01, 0.01))
    read = dataclasses.replace(plain, noise=smc.Noise(position=0.0002, position_error=late))
    labels = wording.run_names(smc.run([plain, read]), None)
    assert labels == ["PID: no noise", "PID: noise position 0.0002, position error Time series"]


def test_contrasts_are_those_of_wcag():
    """Black on white is 21 : 1.

    Grey #757575 is the lightest on which white letters have 4.5 : 1.
    """
    light, grey, black = (
        style.luminance(colour) + 0.05 for colour in ("#FFFFFF", "#757575", "#000000")
    )
    assert light / black == pytest.approx(21.0)
    assert 4.5 < light / grey < 4.7


@pytest.mark.parametrize("colour", ["#009E73", "#7A2D0B", "#0072B2"])
def test_a_ramp_keeps_its_order_on_a_dark_page(colour):
    """A shade that were made lighter for its contrast would pass its neighbour."""
    with plt.style.context("dark_background"):
        neutral = style.neutral_on_dark()
        shades = colouring.ramp(colour, 5)
        light = [style.luminance(shade) for shade in shades]
        assert light == sorted(light, reverse=True)
        assert len(set(light)) == 5
        assert [dark.on_dark(shade, neutral) for shade in shades] == shades
