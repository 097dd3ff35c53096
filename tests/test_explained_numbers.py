"""An explanation has the numbers of the code: each sentence is made of a constant, and stands in
the text.
"""

import importlib
import inspect
import math
from pathlib import Path

import pytest

import smc_mujoco as smc
from smc_mujoco.analysis import differ, ranking
from smc_mujoco.analysis.engine import outcome
from smc_mujoco.analysis.tuning import objective, quick_search, search, search_space, stages
from smc_mujoco.common import constraints
from smc_mujoco.envs import tasks
from smc_mujoco.metrics import catalogue, conventions, fold, limit_cycle, tip
from smc_mujoco.robustness import level_search, margin_kinds, uncertainty
from smc_mujoco.robustness import region_of_attraction as region
from smc_mujoco.robustness import worst_case_search as attack
from smc_mujoco.simulation import (
    conditions,
    controller,
    force_bounds,
    integration,
    signals,
    suite_conditions,
    time_series,
)
from smc_mujoco.studies import race
from smc_mujoco.testing import golden, plugin

pytestmark = pytest.mark.quick

margins = importlib.import_module("smc_mujoco.robustness.margins")  # smc.margins is the function
ROOT = Path(__file__).parents[1]
PARTS = {
    2: "half",
    3: "third",
    4: "quarter",
    6: "sixth",
    8: "eighth",
    10: "tenth",
}
WORDS = {
    2: "two",
    3: "three",
    4: "four",
    5: "five",
    9: "nine",
}


def percent(share: float) -> str:
    return f"{100.0 * share:g} %"


def short(number: float) -> str:
    """A power of ten, such as 1e-3."""
    if math.log10(number) % 1.0 in (0.0, 1.0):
        return f"1e{round(math.log10(number))}"
    return str(number)


def part(share: float) -> str:
    """A share in words, such as eighth."""
    return PARTS[round(1.0 / share)]


def under(condition: str) -> dict:
    """The fields of a condition of the suite."""
    return conditions.NAMED[condition].on(smc.plant("duffing"), 1.0)


SAID = {
    margins: [
        f"at most {percent(margin_kinds.TOLERATED_ERROR)} of its scale",
        f"up to {WORDS[max(len(kind.levels) for kind in margin_kinds.MARGIN_KINDS.values())]} levels",
        f"an {part(1 / uncertainty.JITTER_SHARES)} of one (jitter) or {percent(level_search.FINE)} "
        "(others)",
    ],
    margins.margins: [
        f"runs of {margins.QUICK_DURATION:g} s and search to within "
        f"{level_search.QUANTA[level_search.COARSE]} control periods",
        f"control periods or {percent(level_search.COARSE)}, for a first look",
    ],
    region: [
        f"|e| <= {percent(conventions.SETTLING_BAND)} of X and |v| <= "
        f"{percent(conventions.SETTLING_BAND)} of V",
        f"({percent(math.sqrt(outcome.NEAR_SQUARE))})^2, a "
        f"{part(math.sqrt(outcome.NEAR_SQUARE) / 0.02)} of the band",
        f"for {percent(region.HORIZONS[0])} of the duration",
        f"for {percent(region.HORIZONS[1])}, and those still undecided for the whole duration",
        f"throughout the last {part(1 / region.EARLY_PARTS)} of the run",
        f"is a {part(1.0 - outcome.MAX_EARLY_RATIO)} smaller than in the first",
        f"less than {short(outcome.REST_TOLERANCE)} of X",
        f"throughout the last {percent(fold.LAST_PART)} of the run",
        f"at most {percent(round(outcome.MAX_FINAL_RATIO - 1.0, 9))} larger than in the first",
    ],
    region.basin: [f"V is {region.VELOCITY_RATIO:g} X per second"],
    search: [
        {12: "twelve in a comparison"}[search.SEARCHES],
        f"A search has {search.BUDGET} evaluations for each gain",
        f"An {part(search.SCREENED_SHARE)} screens",
        f"A {part(search.EVOLVED_SHARE)} evolves",
        f"lower J by less than {percent(stages.PATIENCE)}",
        f"differ by more than {percent(search.AGREEMENT)}",
        f"rounded to {WORDS[stages.GAIN_DIGITS]} digits",
    ],
    quick_search: [
        f"{quick_search.BUDGET} evaluations a gain are enough",
        f"{WORDS[quick_search.WIDER]} times the usual size",
        f"at least {WORDS[quick_search.FEWEST]} sets",
        f"best {WORDS[quick_search.DECIDED]} sets are decided",
    ],
    race: [
        f"After {WORDS[race.FIRST]} sets a law is dropped",
        f"judged after {race.LOOKS[0]} sets, and if none wins, after {race.LOOKS[1]}",
        f"more than {race.WITHIN} are needed",
    ],
    search_space: [f"10^-{search_space.HALF_WIDTH:g} .. 10^{search_space.HALF_WIDTH:g}"],
    search_space.at_bound: [f"within {percent(search_space.BOUND_MARGIN)} of a bound"],
    search_space.widened: [f"{ {1.0: 'a decade'}[search_space.WIDENING] } wider on either side"],
    objective: [
        f"w = h times 1 s^2 = {short(objective.Objective().weight)} s^3",
        f"costs {objective.Objective().weight * 2.0 / conditions.CONTROL_PERIOD:g} s^2",
    ],
    differ: [f"are more than {percent(differ.MAX_CHANGE)} apart"],
    ranking: [
        f"there are {ranking.MIN_LEVEL_UNITS} units or more",
        f"lies within {percent(ranking.LEVEL_SHARE)}",
        f"p = {ranking.TREND_POWER:g} without a periodic load",
    ],
    attack: [f"at most {attack.MAX_CORNERS}, each"],
    uncertainty.default_class: [
        f"up to a {part(uncertainty.DEFAULT_FORCE_SHARE)} of the force",
        f"friction within {percent(1.0 - uncertainty.DEFAULT_FRICTION_SCALE[0])}",
    ],
    smc.Scenario: [
        f"Default: {force_bounds.U_MAX:g}; of your own model the limit of the",
        f"else up to {1e3 * integration.MAX_STEP:g} ms",
        f"only friction needs {1e3 * integration.REALISTIC_STEP:g} ms",
        f"a contact {1e3 * integration.BLOW_STEP:g} ms",
        f"to a {PARTS[integration.DRIVE_STEPS]} of that period or half of the drive's time constant",
        f"up to {1e3 * integration.REALISTIC_STEP:g} ms with friction",
        f"up to a {PARTS[integration.MIN_JITTER_STEPS]} of the clock's jitter",
        f"0 .. 2^{math.log2(constraints.MAX_SEED + 1):g} - 1",
    ],
    suite_conditions: [
        f"{force_bounds.U_MAX / suite_conditions.BOUNDS_PER_FRICTION:g} N m or N in the study",
        f"late by up to {part(under('jitter')['clock'].jitter / conditions.CONTROL_PERIOD)} of the",
        f"one sample in {round(1 / under('missed')['clock'].missed)} does".replace("10", "ten"),
    ],
    smc.Clock: [f"0 .. {signals.MAX_MISSED:g}"],
    smc.signals.TimeSeries.from_csv: [f"longer than {time_series.MAX_GAP_STEPS:g} median steps"],
    smc.signals.BandLimited: [f"N = {signals.SINUSOIDS}, phi_i uniform"],
    smc.signals.OrnsteinUhlenbeck: [
        f"`dt` defaults to {1e3 * smc.signals.OrnsteinUhlenbeck(1.0, 1.0).dt:g} ms"
    ],
    smc.signals.Impulse: [
        f"as {1e3 * smc.signals.Impulse(1.0, 0.0).width:g} ms is for default steps"
    ],
    conventions: [
        f"settling band: |e| <= {percent(conventions.SETTLING_BAND)} of the scale",
        f"the last {percent(fold.LAST_PART)} of the run",
        f"the samples with t >= t0 + {1 - fold.LAST_PART:g} (tK - t0)",
        f"|v| <= {percent(conventions.REST_SHARE)} of the group's largest |v|",
        f"or {short(conventions.REST_SPEED)} rad/s or m/s if that is larger",
    ],
    catalogue.rise_time: [
        f"from {percent(catalogue.RISE_LEVELS[0])} to {percent(catalogue.RISE_LEVELS[1])} of "
        "the way",
        f">= {catalogue.RISE_LEVELS[0]:g} to the first with >= {catalogue.RISE_LEVELS[1]:g}",
    ],
    catalogue.hf_share: [f"above {catalogue.HIGH_FREQUENCY:g} Hz, 0 to 1"],
    limit_cycle: [
        f"at least {WORDS[limit_cycle.MIN_PERIODS]} periods",
        f"not below {short(limit_cycle.MAX_MAGNITUDE)}",
        f"less than a {part(limit_cycle.MIN_POWER_SHARE)} of the spectrum's power",
        f"differs by more than {part(limit_cycle.MAX_CHANGE)} from the first",
    ],
    tip.tip_scores: [f"over the last {percent(1.0 - tip.FORCE_START)} of the run"],
    tasks: [
        f"T(rms(w) / {tasks.RATE_MARGIN:g})",
        f"within {tasks.SWING_UP_SPREAD:g} rad of hanging",
    ],
    plugin.smc_golden._fixture_function: [
        f"within {percent(golden.RELATIVE)} of their recorded value"
    ],
    ROOT / "docs" / "design.md": [f"fails at |x| or |v| beyond {short(controller.MAX_STATE)}"],
}


def named(place) -> str:
    if isinstance(place, Path):
        return place.name
    return getattr(place, "fget", place).__name__[-30:]


@pytest.mark.parametrize("place", SAID, ids=named)
def test_an_explanation_has_the_numbers_of_the_code(place):
    if isinstance(place, Path):
        text = place.read_text(encoding="utf-8")
    else:
        text = inspect.getdoc(place) or ""
    text = " ".join(text.split())
    assert SAID[place]
    for sentence in SAID[place]:
        assert sentence in text
