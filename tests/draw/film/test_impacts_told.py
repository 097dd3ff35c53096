"""Blows and hits in words, and arrows that are longer than fits: broken, with their numbers."""

import dataclasses
import itertools

import numpy as np
import pytest
from helpers.films import staged
from helpers.sketch import made
from PIL import Image

import smc_mujoco as smc
from smc_mujoco.common import gl
from smc_mujoco.draw import states, style
from smc_mujoco.draw.decimate import Envelope
from smc_mujoco.draw.film import arrows, film, flat_arrows, pace

renders = pytest.mark.skipif(gl.missing_renderer() is not None, reason=str(gl.missing_renderer()))
RED = (1.0, 0.0, 0.0, 1.0)


def struck(width):
    """A pendulum at rest that 2 N m s hit at 0.1 s, and that then hits a stop."""
    return smc.run(
        smc.Scenario(
            plant="inverted_pendulum",
            law=smc.law("classical"),
            x0=0.0,
            contact=smc.hardware.Contact("stops", restitution=0.8),
            disturbance=smc.signals.Impulse(2.0, time=0.1, width=width),
            duration=0.6,
        )
    )


@pytest.fixture(scope="module")
def run():
    return struck(0.01)


def test_a_blow_is_told_with_its_peak_from_its_start_and_fades(run):
    clock = pace.clock([run], 100.0, 0.1)
    said = {}
    timeline = states.timeline(run, clock.times, clock.played)
    for time, state in zip(clock.times, timeline, strict=True):
        if state and state.words == "blow, 200 N·m":
            said[round(float(time), 3)] = state
    first, *_, last = said
    assert first == 0.1
    assert last >= 0.1 + 0.1 * (states.HOLD_TIME + 0.5 * states.MIN_STATE_TIME)
    opacities = [state.opacity for state in said.values()]
    assert opacities[0] == 1.0
    assert opacities == sorted(opacities, reverse=True)
    assert opacities[-1] < 0.8
    assert all(state.colour == style.DISTURBANCE and state.peak for state in said.values())


@pytest.mark.quick
def test_an_impulse_that_lasts_is_no_blow():
    timeline = states.timeline(struck(0.2), np.arange(0.1, 0.3, 1e-2))
    assert not any(state.words.startswith("blow") for state in timeline if state)


def test_every_first_contact_is_a_hit_with_its_peak_and_what_lasts_after_it_a_contact(run):
    """An arm that struck a wall and stayed on it was never said to hit it."""
    t = run.t
    touches = (t >= 0.1) & (t < 0.5)
    touches[np.searchsorted(t, 0.13) : np.searchsorted(t, 0.14)] = False  # it bounces
    force = np.where(touches, 20.0, 0.0)
    force[np.searchsorted(t, 0.15)] = 63.0
    force[np.searchsorted(t, 0.3)] = 90.0
    words = "hit", "contact"
    timeline = states.told(run, 4.0 * t, touches[:, None], force[:, None], words, style.REACTION)
    said = [state.words if state else None for state in timeline]
    assert [word for word, _ in itertools.groupby(said)] == [None, "hit, 63 N·m", "contact", None]
    assert t[said.index("hit, 63 N·m")] == pytest.approx(0.1)
    assert t[said.index("contact")] == pytest.approx(0.1 + states.HOLD_TIME / 4.0, abs=2e-3)
    assert all(state.opacity == 1.0 for state in timeline[: np.searchsorted(t, 0.499)] if state)
    since = states.told(run, t, (t < 0.5)[:, None], force[:, None], words, style.REACTION)
    assert {state.words for state in since if state} == {"contact"}


def test_words_are_shown_for_as_long_as_it_takes_to_read_them_unless_something_is_hit(run):
    """A machine that was let go said "sticks" for a picture, and an error changed in each."""
    drone = made(smc.Scenario(plant="quadrotor", law="geometric", duration=0.6))
    drone = dataclasses.replace(drone, x=drone.r + drone.t[:, None])
    times = np.arange(0.0, 0.6, 1e-3)
    for trace in (run, drone):
        said = [state.words if state else None for state in states.timeline(trace, times)]
        spells = [(word, len(list(group))) for word, group in itertools.groupby(said)]
        assert len(spells) > 2
        for (word, count), (then, _) in itertools.pairwise(spells[1:]):
            long = count >= 1e3 * states.MIN_STATE_TIME - 2
            assert long or word is None or str(then).startswith("hit")
    stuck = dataclasses.replace(
        run.scenario, friction=smc.Coulomb(0.05), x0=0.5, disturbance=None, contact=None
    )
    first = smc.run(dataclasses.replace(stuck, duration=0.1))
    assert set(states.timeline(first, np.arange(0.0, 0.1, 1e-3))) == {None}


def test_an_arrow_is_broken_if_it_is_cut_and_its_number_is_told(run):
    runs = film.DrawnRuns.of([run], None)
    clock = pace.clock([run], 30.0)
    (track,) = film.tracks_at(clock, runs, arrows.scales([run]))
    broken = {style.DISTURBANCE: 0, style.REACTION: 0}
    for drawn, state in zip(track.drawn, track.states, strict=True):
        for _, arrow in drawn.arrows:
            assert arrow.cut == (abs(arrow.high) > arrows.CUT)
            for colour in broken:
                if arrow.cut and arrow.rgba == arrows.rgba(colour):
                    broken[colour] += 1
                    assert state
                    assert state.colour == colour  # the number is in its words
                    assert arrow.words == ""
                    assert arrow.on_blow
    assert min(broken.values()) > 0


@pytest.mark.parametrize("length", [20.0, 60.0])
def test_the_break_of_an_arrow_is_in_its_shaft_however_short(length):
    from scipy.ndimage import label

    for cut, parts in ((False, 1), (True, 2)):
        image = Image.new("RGB", (100, 40), "white")
        line = np.linspace((20.0, 20.0), (20.0 + length, 20.0), 40)
        flat_arrows.stamp(image, line, 5.0, arrows.Arrow(0.0, 1.0, RED, cut=cut))
        inked = np.asarray(image)[..., 1] < 128
        _, count = np.asarray(label(inked), object)
        assert count == parts
        gap = np.flatnonzero(~inked[20, 20 : 20 + int(length / 2)])
        assert (len(gap) > 0) == cut
        assert not cut or 0.2 * length <= gap.mean() <= 0.3 * length


def test_the_arrow_of_a_reaction_is_hollow_and_that_of_a_disturbance_has_a_bar():
    """In grey they looked like the control's."""
    line = np.linspace((10.0, 20.0), (80.0, 20.0), 40)
    for hollow in (False, True):
        image = Image.new("RGB", (100, 40), "black")
        flat_arrows.stamp(image, line, 12.0, arrows.Arrow(0.0, 1.0, RED, hollow=hollow), 2)
        inside, edge = image.getpixel((20, 20)), image.getpixel((20, 15))
        assert edge == flat_arrows.bytes_of(RED)
        assert inside == (style.rgb(style.PAPER) if hollow else edge)
    bare, barred = [flat_arrows.outline(line, 4.0, foot=foot) for foot in (False, True)]
    widths = [np.ptp(edge[np.abs(edge[:, 0] - 10.0) < 1.0, 1]) for edge in (bare, barred)]
    assert widths == pytest.approx([4.0, 4.0 * flat_arrows.FOOT_WIDTH])
    force = Envelope(np.zeros(1), *np.ones((3, 1, 1)))
    acting = dict.fromkeys(("control", "disturbance", "reaction"), force)
    scale = arrows.Scale(1.0, 1.0, 1.0, longest=1.0, full=1.0, units=("N", "N"))
    drawn = arrows.arrows(acting, 0, 0, scale, style.INK)
    assert [(arrow.hollow, arrow.foot) for arrow in drawn] == [
        (False, False),
        (False, True),
        (True, False),
    ]


@renders
def test_the_arrow_of_a_hit_is_not_drawn_under_the_words_that_have_its_number(run):
    """Its head stood out of the digits."""
    with staged(run, (640, 360)) as stage:
        stage.pose(0, 0.0)
        stage.words = []
        bare = stage.render().astype(int)
        arrow = arrows.Arrow(0.0, -1.0, RED)
        y, x = np.nonzero((np.abs(stage.render([(0, arrow)]) - bare) > 60).any(axis=2))
        box = np.array([(x.min(), y.min()), (x.max(), y.max())], float)
        tail = np.array([(box[1, 0] - 5.0, box[0, 1]), box[1]])
        for words, on_blow, drawn in (
            (tail, True, False),
            (tail, False, True),
            (tail + 10.0, True, True),
        ):
            stage.words = [words]
            seen = stage.render([(0, arrow._replace(on_blow=on_blow))])
            assert (np.abs(seen - bare) > 60).any() == drawn


def test_words_of_a_hit_and_its_arrow_at_its_peak_stay_and_fade_together(run):
    """They stood for 0.2 s of a film."""
    runs = film.DrawnRuns.of([run], None)
    clock = pace.clock([run], 30.0, 0.25)
    (track,) = film.tracks_at(clock, runs, arrows.scales([run]))
    spells = []
    frames = zip(track.states, track.drawn, strict=True)
    for words, spell in itertools.groupby(frames, key=lambda one: one[0] and one[0].words):
        if words is None or not words.startswith("hit"):
            continue
        lengths = set()
        full = 0
        for state, drawn in spell:
            assert state
            shade = arrows.rgba(state.colour, state.opacity)
            (own,) = [arrow for _, arrow in drawn.arrows if arrow.rgba == shade]
            lengths.add(own.high)
            full += state.opacity == 1.0
        assert len(lengths) == 1
        spells.append(full / 30)
    assert len(spells) >= 1
    assert min(spells) >= states.HOLD_TIME - 1 / 30


def test_a_strong_hit_is_told_until_it_fades_though_a_weak_one_follows(run):
    t = run.t
    force = np.zeros(len(t))
    force[np.searchsorted(t, 0.1)] = 50.0
    force[np.searchsorted(t, 0.3)] = 20.0
    words = "hit", "contact"
    acts = (force != 0.0)[:, None]
    for forces, expected in (
        (force, ["hit, 50 N·m", "hit, 20 N·m"]),
        (70.0 * (force > 0.0) - force, ["hit, 20 N·m", "hit, 50 N·m"]),
    ):
        timeline = states.told(run, 2.0 * t, acts, forces[:, None], words, style.REACTION)
        said = [state.words if state else None for state in timeline]
        assert [word for word, _ in itertools.groupby(said)] == [None, *expected]
        turn = (
            0.1 + 0.5 * (states.HOLD_TIME + states.MIN_STATE_TIME)
            if expected[0] > "hit, 3"
            else 0.3
        )
        assert t[said.index(expected[1])] == pytest.approx(turn, abs=2e-3)
