"""A race: equal numbers of sets, laws that are dropped, searches made again, two looks, a clock."""

import contextlib
import math
import types

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis import step_halving
from smc_mujoco.analysis.ranking import RELEVANT, Comparison
from smc_mujoco.analysis.tuning.effort import Search
from smc_mujoco.analysis.tuning.objective import Evaluation, Objective, objectives
from smc_mujoco.analysis.tuning.result import SearchResult
from smc_mujoco.answers.facts import Settles
from smc_mujoco.common.progress import Bar
from smc_mujoco.simulation.grid import Draws
from smc_mujoco.studies import race as module
from smc_mujoco.studies.answer_time import FEWEST_SEEDS, AnswerTime
from smc_mujoco.studies.fair_gains import default_of
from smc_mujoco.studies.recommend import in_order

GOAL = Objective(conditions=("nominal",), duration=1.0)
SPREAD, STUCK_SHARE, STUCK_BY = 0.25, 0.2, 0.7  # of log J between searches, as a pilot saw them


def drawn(random, lead):
    """J in training and on unseen runs of a search of a law that is worse by a lead."""
    trained = SPREAD * random.standard_normal() + STUCK_BY * (random.random() < STUCK_SHARE)
    trained += math.log1p(lead)
    return math.exp(trained), math.exp(trained + 0.1 * random.standard_normal())


class Drawn(module.SearchedEntrant):
    """A law whose searches are random numbers, each with its J on unseen runs."""

    def __init__(self, name, lead, random):
        self.law = smc.law("none").named(name)
        self.J, self.results, self.again, self.share = [], [], set(), 1
        self.lead, self.random = lead, random
        self.outcome = {}

    @staticmethod
    def wait(seconds):
        """What lets time pass while a law is searched or judged."""

    def search(self, k, draw, ends):
        self.wait(10.0 / self.share)
        if (k or draw) and module.time.monotonic() > ends:
            raise module.OutOfTime
        trained, J = drawn(self.random, self.lead)
        self.outcome[k, trained] = J
        best = Evaluation((1.0,), trained, trained, 0.0)
        return SearchResult(best=best, history=(best,), evaluations=1, engine="")

    def gains(self, k):
        return self.outcome[k, self.results[k].best.objective]


@pytest.fixture
def run(monkeypatch):
    """Return what races laws, name -> lead, whose searches are drawn."""
    nothing = types.SimpleNamespace(read=lambda: None, keep=lambda result: result, path=None)
    monkeypatch.setattr(module, "_file", lambda *piece: nothing)
    monkeypatch.setattr(module, "_judgement", lambda *piece: nothing)
    monkeypatch.setattr(
        module, "_work", lambda course, entrant, k=0: 10.0 / (1 if k else entrant.share)
    )
    monkeypatch.setattr(module, "writable", lambda *paths: None)

    def unseen(trial, plant, values, goal, numbers):
        Drawn.wait(module.judgements(numbers))
        return np.array(values), np.full(len(values), math.nan)

    monkeypatch.setattr(module, "unseen", unseen)

    def raced(leads, seed=0, clock=None):
        random = np.random.default_rng(seed)
        entrants = [Drawn(name, lead, random) for name, lead in leads.items()]
        return module.race(course(clock), entrants, RELEVANT)

    return raced


def course(clock=None):
    trial = types.SimpleNamespace(progress=False, search=Search())
    return module.RaceCourse(trial, None, GOAL, clock or AnswerTime())


@pytest.fixture
def now(monkeypatch):
    """Return the time, s, in a list: a search takes 10 s, and a judgement 1 s."""
    time = [0.0]

    def wait(seconds):
        time[0] += seconds

    monkeypatch.setattr(Drawn, "wait", staticmethod(wait))
    monkeypatch.setattr(module.time, "monotonic", lambda: time[0])
    return time


@pytest.mark.quick
def test_a_law_that_cannot_win_any_more_is_dropped_and_two_stay():
    J = {"a": [1.0, 1.2, 1.1], "b": [2.5, 2.41, 3.0], "c": [0.9, 1.9, 2.0]}
    assert module.hopeless(J) == {"b": pytest.approx(2.41 / 1.2)}
    assert module.hopeless(J | {"b": [2.39, 9.0, 9.0]}) == {}
    assert module.hopeless({"a": [1.0] * 3, "b": [9.0] * 3}) == {}
    assert module.hopeless({"a": [1.0] * 3, "b": [9.0] * 3, "c": [5.0] * 3}) == {"b": 9.0}
    assert module.hopeless({"a": [1.0] * 3, "none": [5.0] * 3, "c": [9.0] * 3}) == {"none": 5.0}
    assert module.hopeless({"a": [9.0] * 3, "b": [9.0] * 3, "none": [1.0] * 3}) == {}


def test_a_search_is_stuck_beside_the_others_of_its_law():
    assert module.stuck([0.1]) == []
    assert module.stuck([0.1, 0.21]) == [1]
    assert module.stuck([0.3, 0.1, 0.19]) == [0]
    assert module.stuck([0.3, 0.3]) == []


def test_laws_have_equal_numbers_of_sets_and_a_clear_lead_ends_the_race_at_the_first_look(run):
    raced = run({"a": 0.0, "b": 2.0, "c": 9.0})
    assert raced.winner == "a"
    assert raced.first == ["a"]
    assert [*raced.dropped] == ["c"]
    assert {name: len(entrant.results) for name, entrant in raced.entrants.items()} == {
        "a": 7,
        "b": 7,
        "c": 3,
    }
    assert raced.sets == 7
    assert not raced.stopped


def test_a_stuck_search_is_made_once_more_and_the_better_one_is_judged(run):
    again = 0
    for seed in range(10):
        for entrant in run({"a": 0.0, "b": 0.3}, seed).entrants.values():
            again += len(entrant.again)
            for k, search_result in enumerate(entrant.results):
                tried = [trained for number, trained in entrant.outcome if number == k]
                assert len(tried) == 1 + (k in entrant.again)
                assert search_result.best.objective == min(tried)
                assert entrant.values[k] == entrant.outcome[k, min(tried)]
    assert again


def test_a_race_goes_on_after_the_first_look_only_if_it_may_be_decided(run):
    """Each look has half of the errors, for as many rivals as there are."""
    ended = {}
    for seed in range(30):
        raced = run({"a": 0.0, "b": 0.4, "c": 0.5}, seed)
        levels = raced.comparison.error, raced.comparison.limit
        assert levels == pytest.approx((0.0125, 0.025 / (len(raced.running) - 1)))
        far = raced.winner is None and module.needed(raced.comparison) > module.WITHIN
        ended.setdefault(raced.sets, []).append((raced.winner is not None, far))
    assert [*sorted(ended)] == [7, 12]
    assert all(won or far for won, far in ended[7])
    assert any(far for _, far in ended[7])


def test_the_clock_ends_a_race_between_two_rounds(run, now):
    raced = run({"a": 0.0, "b": 2.0}, clock=AnswerTime(110.0))
    assert raced.stopped
    assert 1 < raced.sets < module.LOOKS[0]
    assert {len(entrant.results) for entrant in raced.entrants.values()} == {raced.sets}
    assert raced.winner is None
    assert raced.first == raced.running == ["a", "b"]


def test_a_race_that_stops_between_its_looks_keeps_what_the_first_look_said(run, now):
    uninterrupted = run({"a": 0.0, "b": 0.6}, 3)
    assert (uninterrupted.sets, uninterrupted.looked) == (12, 12)
    ends = []
    for end in range(60, 400, 40):
        now[0] = 0.0
        raced = run({"a": 0.0, "b": 0.6}, 3, AnswerTime(float(end)))
        if raced.sets not in module.LOOKS:
            ends.append(raced.sets > 7)
            assert raced.looked == min(raced.sets, 7)
            assert int(raced.comparison.seeds[0]) == raced.looked
    assert True in ends


@pytest.fixture
def shown(monkeypatch):
    """Return the bars of races, and what each was told: the work done, the whole, and its words."""
    bars = []
    counts = []

    class Recorded(Bar):
        def reached(self, done, whole):
            super().reached(done, whole)
            counts.append((done, whole, self.what))

    def recorded(*given, **named):
        bars.append(Recorded(*given[:2]))
        return contextlib.nullcontext(bars[-1])

    monkeypatch.setattr(module, "bar", recorded)
    return bars, counts


def test_the_bar_never_shows_more_sets_than_are_to_be_made(run, shown, monkeypatch):
    """Beyond the first look, and after a law was dropped."""
    bars, counts = shown
    monkeypatch.setattr(module, "WITHIN", math.inf)
    raced = run({"a": 0.0, "b": 0.0, "c": 99.0})
    assert (raced.sets, [*raced.dropped]) == (12, ["c"])
    assert all(done <= total for done, total, _ in counts)
    assert counts[-1][:2] == (24, 24)
    assert str(bars[0]).startswith(f"{module.SETS} (out of the race: c)")


@pytest.mark.parametrize(("end", "fit"), [(85.0, 3), (105.0, 4), (150.0, 6), (190.0, None)])
def test_the_bar_says_once_the_sets_are_timed_if_too_few_fit(
    run, shown, now, monkeypatch, end, fit
):
    """A set of a law takes 11 to 13 s, and none is searched again."""
    monkeypatch.setattr(module, "stuck", lambda J: [])
    raced = run({"a": 0.0, "b": 0.0}, clock=AnswerTime(end))
    words = [what for done, _, what in shown[1] if done == 6]
    if fit is None:
        assert raced.sets >= module.LOOKS[0]
        assert words[0] == module.SETS
    else:
        assert raced.sets == fit
        assert f"(about {fit} of each law fit, and 7 can name a winner)" in words[0]


def test_a_race_leaves_the_time_that_the_runs_after_it_take(run, now):
    """By the pace of its own judgements, which is known once a law was judged."""
    sets = []
    for after in (0.0, 80.0, 115.0):
        now[0] = 0.0
        clock = AnswerTime(160.0, after=after - 20.0, table=4.0, choice=6.0, unit=1.0)
        sets.append(run({"a": 0.0, "b": 2.0}, clock=clock).sets)
        assert clock.pace == 1.0
        assert now[0] <= clock.race_ends(2) == 160.0 - after
    assert sets[0] > sets[1] > sets[2] == 1


def test_every_law_gets_a_first_set_from_a_shorter_search_where_time_is_short(run, now):
    """Before the time of tables; a search that the clock ends does not count."""
    laws = dict.fromkeys("abcdefgh", 0.0)
    clock = AnswerTime(100.0, after=1.0, table=4.0, choice=50.0, unit=1.0)
    raced = run(laws, clock=clock)
    assert [*raced.entrants] == [*laws]
    assert raced.shorter
    assert raced.sets == 1
    assert raced.seconds == pytest.approx(8 * (10.0 + 1.0))  # of whole searches, each judged once
    assert {entrant.share for entrant in raced.entrants.values()} <= {1, 2, 4}
    assert now[0] <= 100.0
    assert not run(laws, clock=AnswerTime(now[0] + 1000.0)).shorter
    late = run(laws, clock=AnswerTime(now[0] + 12.0))
    assert [*late.entrants][:1] == ["a"]
    assert {*late.entrants} | {*late.unsearched} == {*laws}
    assert late.stopped


def test_an_interrupted_round_does_not_count(run, now):
    """So that laws have equal numbers of sets."""
    raced = run({"a": 0.0, "b": 0.0}, clock=AnswerTime(48.0))
    assert {len(entrant.results) for entrant in raced.entrants.values()} == {raced.sets}
    assert now[0] <= 48.0 + 10.0


def test_no_law_races_and_wins_where_it_is_best(run, monkeypatch):
    monkeypatch.setattr(
        module,
        "unseen",
        lambda *given: (
            np.array([value if isinstance(value, float) else 0.1 for value in given[2]]),
            np.full(len(given[2]), math.nan),
        ),
    )
    none = module.ReadyEntrant(default_of(smc.law("none")))
    random = np.random.default_rng(0)
    worse = Drawn("a", 5.0, random)
    raced = module.race(course(), [none, worse], RELEVANT)
    assert raced.winner == "none"
    assert raced.laws == ["a"]


def test_tables_have_fewer_runs_in_a_short_time_but_some(monkeypatch):
    monkeypatch.setattr(module.time, "monotonic", lambda: 0.0)
    clock = AnswerTime(100.0, pace=0.1)
    assert clock.seeds(14, work=50.0, then=300.0) == 14
    assert clock.seeds(14, work=70.0, then=300.0) == 10
    assert clock.seeds(14, work=70.0, then=1000.0) == FEWEST_SEEDS
    assert clock.seeds(2, work=70.0, then=1000.0) == 2
    assert AnswerTime(100.0).seeds(14, work=1e9, then=1e9) == 14  # nothing was timed


@pytest.mark.slow
def test_laws_of_one_name_win_seldom_and_a_lead_of_three_times_is_named(run):
    """Two, three and five laws; a wrong winner of two equal laws is allowed in 5 % of races."""
    wins = [run({"a": 0.0, "b": 0.0}, seed).winner for seed in range(200)]
    assert sum(map(bool, wins)) <= 17  # 99 % of the time, of 5 %
    for rivals in ("b", "bcde"):
        leads = {"a": 0.0} | dict.fromkeys(rivals, 2.0)
        assert sum(run(leads, seed).winner == "a" for seed in range(20)) >= 18
    equal = [run(dict.fromkeys("abc", 0.0), seed).winner for seed in range(40)]
    assert not any(equal)


def test_the_same_searches_under_two_names_have_no_winner(run, monkeypatch):
    """As in a race of one law under two names, whose searches have the same random numbers."""
    monkeypatch.setattr(module, "WITHIN", math.inf)
    for seed in range(5):
        randoms = [np.random.default_rng(seed) for _ in "ab"]
        pairs = zip("ab", randoms, strict=True)
        entrants = [Drawn(name, 0.0, random) for name, random in pairs]
        raced = module.race(course(), entrants, RELEVANT)
        assert raced.winner is None
        assert raced.sets == module.LOOKS[-1]
        assert raced.first == ["a", "b"]


ROBOT = """<mujoco><worldbody><geom type="plane" size="1 1 .1"/><body pos="0 0 .6">
<joint name="j" axis="0 1 0" frictionloss=".05"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass=".4"/></body></worldbody>
<actuator><motor joint="j" ctrlrange="-4 4"/></actuator></mujoco>"""


def test_unseen_runs_under_rk4_have_twice_the_step_and_one_in_four_their_own():
    robot = smc.plant_from(ROBOT, ["j"], name="robot")
    law = smc.law("pid", kp=20.0, ki=20.0, kd=2.0)
    goal = Objective(conditions=("friction", "delay_10ms"), duration=1.0)
    trial = types.SimpleNamespace(draws=Draws(2), threads=1)
    steps = {case.resolved.physics_step for case in goal.holdout(robot, law, 0)}
    assert {case.resolved.integrator for case in goal.holdout(robot, law, 0)} == {"RK4"}
    assert (
        max(steps) < goal.control_period
    )  # so they may be doubled, as those of light stops may not
    fast, own = module.unseen(trial, robot, [law] * 2, goal, [0, 1])
    J, _ = objectives(robot, [law] * 2, goal, [0, 1], 1)
    assert own[0] == J[0]
    assert math.isnan(own[1])
    assert (fast != J).all()
    np.testing.assert_allclose(fast, J, rtol=0.01)


@pytest.mark.parametrize(
    "fields",
    [
        {"friction": smc.Coulomb(0.1), "integrator": "implicitfast"},  # of first order
        {"control_period": 1e-3},  # the step of RK4 is the period
        {"input_delay": 5e-4, "physics_step": 2.5e-4, "control_period": 7.5e-4},
    ],
)
def test_runs_that_cannot_have_twice_the_step_keep_theirs(fields):
    scenario = smc.Scenario(plant="duffing", law=smc.law("pid"), **fields)
    assert step_halving.doubled(scenario) is scenario


def test_the_law_to_use_is_the_one_that_runs_name_where_sets_name_none():
    """It must settle, too, and one that settles in no run comes after one that does in some."""
    runs = 1.0 + 0.01 * np.sin(np.arange(12))
    fixed = Comparison({"a": [2.0 * runs], "b": [runs]})
    assert fixed.winners == ["b"]
    for of_a, of_b, winner, order in (
        (10, 10, None, ["b", "a"]),
        (10, 10, "a", ["a", "b"]),
        (10, 1, None, ["a", "b"]),
        (2, 1, None, ["b", "a"]),
        (1, 0, None, ["a", "b"]),
    ):
        settled = {
            "a": {"noise": Settles(count=of_a, total=10)},
            "b": {"noise": Settles(count=of_b, total=10)},
        }
        raced = types.SimpleNamespace(winner=winner, first=["a", "b"])
        assert in_order(settled, fixed, raced) == order
    assert in_order({"a": {"noise": Settles(count=10, total=10)}}, None, None) == ["a"]


def test_where_nothing_decides_a_law_that_rests_comes_before_one_that_shakes():
    settled = {law: {"noise": Settles(count=10, total=10)} for law in "abc"}
    undecided = types.SimpleNamespace(winner=None, first=["a", "b"])
    assert in_order(settled, None, undecided, ["a"]) == ["b", "a", "c"]
    assert in_order(settled, None, undecided, ["a"], {"b": 1, "c": 2}) == ["a", "b", "c"]
    decided = types.SimpleNamespace(winner="a", first=["a"])
    assert in_order(settled, None, decided, ["a"]) == ["a", "b", "c"]


@pytest.mark.parametrize(("end", "judgements"), [(1000.0, 2), (0.5, 1)])
def test_u_0_is_judged_again_for_the_pace_only_while_there_is_time(end, judgements, now, run):
    clock = AnswerTime(end)
    entrant = module.Entrant(smc.law("none"))
    entrant.gains = lambda k: 1.0
    module._first_sets(course(clock), [entrant], types.SimpleNamespace(says=lambda *_: None))
    assert now[0] == pytest.approx(sum(1 + 2 * (k % 4 == 0) for k in range(judgements)))
    assert len(entrant.J) == 1
