"""What explains a score: indices against closed forms, regions and improvements against planted
ones, whole runs.
"""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.engine import scored_runs
from smc_mujoco.robustness import sobol as module
from smc_mujoco.robustness.sensitivity import default_class, default_points
from smc_mujoco.robustness.uncertainty import Members


def scenario(**fields) -> smc.Scenario:
    return smc.Scenario(**{"plant": "duffing", "law": smc.law("pid"), "duration": 0.5} | fields)


def space(*names: str) -> SimpleNamespace:
    """Axes from 0 to 10 s."""
    return SimpleNamespace(names=names, ends=[(0.0, 10.0, "s")] * len(names))


def test_indices_of_ishigami_s_function_are_its_closed_forms():
    """T. Ishigami & T. Homma, ISUMA 1990, with a = 7, b = 0.1: two axes act together, one alone,
    and a fourth never.
    """
    n = 4096
    three = 2.0 * math.pi
    designs = module.designs(n, 4, 0)
    x = three * designs - math.pi
    scores = np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    axes = module.indices(space(*"abcd"), scores, n, designs[: 2 * n], scores[: 2 * n], 0)
    variance = 49.0 / 8.0 + 0.1 * math.pi**4 / 5.0 + 0.01 * math.pi**8 / 18.0 + 0.5
    first = 0.5 * (1.0 + 0.1 * math.pi**4 / 5.0) ** 2 / variance, 49.0 / 8.0 / variance, 0.0, 0.0
    interaction = 8.0 * 0.01 * math.pi**8 / 225.0 / variance
    for axis, alone, more in zip(
        axes,
        first,
        (interaction, 0.0, interaction, 0.0),
        strict=True,
    ):
        assert axis.first.median == pytest.approx(alone, abs=0.02)
        assert axis.total.median == pytest.approx(alone + more, abs=0.02)
        assert axis.total.low <= alone + more <= axis.total.high
    assert axes[3].total[:3] == (0.0, 0.0, 0.0)


@pytest.mark.quick
def test_an_interval_is_a_point_at_the_level_0_and_grows_to_both_sides_with_the_level(monkeypatch):
    n = 64
    designs = module.designs(64, 2, 0)
    ends = []
    scores = designs @ np.array([1.0, 2.0]) - 4.0
    monkeypatch.setattr(module, "RESAMPLES", 99)
    for level in (0.0, 0.9):
        monkeypatch.setattr(module, "LEVEL", level)
        axes = module.indices(space("a", "b"), scores, n, designs[: 2 * n], scores[: 2 * n], 0)
        ends.append(
            np.array(
                [(kind.low, kind.high) for axis in axes for kind in (axis.first, axis.total)]
            ).T
        )
    lows, highs = np.swapaxes(ends, 0, 1)
    assert lows[0] == pytest.approx(highs[0])
    assert np.all(np.diff(lows, axis=0) < 0.0)
    assert np.all(np.diff(highs, axis=0) > 0.0)


@pytest.mark.parametrize("seed", range(3))
def test_no_axis_explains_more_alone_than_with_others(seed):
    """Few points, and an axis that tells all but 1 %: the estimates of the others' first indices
    are up to 0.1.
    """
    n = 64
    k = 4
    designs = module.designs(n, k, seed)
    scores = designs[:, 0] + 0.1 * designs[:, 1:].sum(axis=1) - 1.0
    axes = module.indices(space(*"abcd"), scores, n, designs[: 2 * n], scores[: 2 * n], seed)
    for axis in axes:
        for alone, more in zip(axis.first[:3], axis.total[:3], strict=True):
            assert alone <= more
    assert axes[0].first.median > 0.8


@pytest.mark.parametrize("seed", range(3))
def test_sums_of_first_indices_are_at_most_1_and_of_total_ones_at_least(seed):
    """With few points an estimate of either sum may lie half of it beyond: eight axes that add up,
    and a cliff.
    """
    n = 16
    k = 8
    designs = module.designs(n, k, seed)
    for scores in (
        designs.sum(axis=1) - 5.0,
        (designs[:, 0] > 0.8) + 0.2 * designs[:, 1] * designs[:, 2] - 1.0,
    ):
        axes = module.indices(
            space(*"abcdefgh"), scores, n, designs[: 2 * n], scores[: 2 * n], seed
        )
        first, total = (
            sum(getattr(axis, kind).median for axis in axes) for kind in ("first", "total")
        )
        assert first <= 1.0 + 1e-12
        assert total >= 1.0 - 1e-12


def test_estimates_beyond_what_indices_obey_are_brought_within():
    corrected = module.possible(np.array([1.2, 0.8, -0.1]), np.array([0.9, 0.6, 0.0]))
    np.testing.assert_allclose(corrected, [[0.6, 0.4, 0.0], [0.9, 0.6, 0.0]])
    corrected = module.possible(np.array([0.5, 0.3]), np.array([0.4, 0.4]))
    np.testing.assert_allclose(corrected, [[0.5, 0.3], [0.5, 0.5]])
    assert not module.possible(np.zeros(2), np.zeros(2)).any()


def test_first_indices_leave_out_what_two_samples_have_in_common_by_chance():
    """The first axis tells nearly all.

    Saltelli's estimates (2010) err three times as much; total ones are equal.
    """
    from scipy.stats import sobol_indices

    n = 32
    k = 8
    errors = []
    for seed in range(20):
        designs = module.designs(n, k, seed)
        scores = 10.0 * designs[:, 0] + 0.3 * designs[:, 1:].sum(axis=1)
        a, b, *mixed = scores.reshape(-1, 1, n)
        theirs = sobol_indices(
            func={
                "f_A": a.copy(),
                "f_B": b.copy(),
                "f_AB": np.array(mixed),
            },
            n=n,
        )
        first, total = module.estimates(a, b, np.array(mixed))
        np.testing.assert_allclose(total[0], np.ravel(theirs.total_order), atol=1e-12)
        true = np.array([100.0] + [0.09] * 7) / (100.0 + 7 * 0.09)
        errors.append(
            [
                np.square(indices - true).mean()
                for indices in (first[0], np.ravel(theirs.first_order))
            ]
        )
    ours, saltelli = np.sqrt(np.mean(errors, axis=0))
    assert ours < saltelli / 3.0


def test_indices_of_scores_that_one_sample_alone_tells_apart_are_numbers():
    a = np.zeros((1, 8))
    b = np.arange(8.0)[None]
    for pair in (
        (a, b),
        (b, a),
        (b, b),
        (b, -b),
    ):
        first, total = module.estimates(*pair, np.array([pair[1], pair[0]]))
        assert np.isfinite([first, total]).all()


def test_positive_scores_are_compared_by_their_ratio():
    designs = module.designs(1024, 2, 0)
    scores = 10.0 ** (3.0 * designs[:, 0] + 2.0 * designs[:, 1])
    axes = module.indices(space("a", "b"), scores, 1024, designs[:2048], scores[:2048], 0)
    assert [axis.total.median for axis in axes] == pytest.approx([9 / 13, 4 / 13], abs=0.01)
    assert axes[0].direction > axes[1].direction > 0.4


@pytest.mark.parametrize("seed", range(3))
def test_a_planted_region_is_found_and_told_by_the_other_half(seed):
    shares = np.random.default_rng(seed).random((512, 3))
    inside = (shares[:, 0] > 0.625) & (shares[:, 2] < 0.5)
    failed = inside.copy()
    failed[:256] &= np.arange(256) % 10 != 0  # the half that chooses
    failed[256:] &= np.arange(256) % 2 == 0  # the half that tells
    [region] = module.regions(space("a", "b", "c"), shares, failed)
    assert sorted(region.cuts) == [module.Cut(0, low=0.625), module.Cut(2, high=0.5)]
    reported = slice(256, None)
    assert region.rate.n == inside[reported].sum()
    assert region.rate.median * region.rate.n == pytest.approx(failed[reported].sum())
    assert region.rate.low < 0.5 < region.rate.high
    assert region.outside.median == 0.0
    assert region.outside.n == 256 - region.rate.n


BORDERS = [  # where runs fail on an axis, the bounds that are found, and the half to narrow to
    (lambda x: x > 0.82, {"low": 0.8125}, {"high": 0.5}),
    (lambda x: x < 0.3, {"high": 0.3125}, {"low": 0.5}),
    (
        lambda x: (x < 0.17) | (x > 0.83),
        {"low": 0.1875, "high": 0.8125, "outside": True},
        {"low": 0.25, "high": 0.75},
    ),
    (
        lambda x: (x < 0.33) | (x > 0.67),
        {"low": 0.3125, "high": 0.6875, "outside": True},
        {"low": 0.25, "high": 0.75},
    ),
    (lambda x: (x > 0.38) & (x < 0.62), {"low": 0.375, "high": 0.625}, None),
    (lambda x: x > 2.0, None, {"high": 0.5}),
]


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize(("fails", "bounds", "half"), BORDERS)
def test_failures_on_one_side_on_both_or_between_have_their_bounds(fails, bounds, half, axis):
    """Of 32 points, as many as a design's quick half has; the score rises with the axis."""
    shares = module.designs(32, 2, axis)[:64]
    failed = fails(shares[:, axis])
    values = np.where(failed, 9.0, 1.0 + shares[:, axis])
    regions = module.regions(space("a", "b"), shares, failed)
    better = module.improvement(space("a", "b"), shares, values, failed)
    if bounds is None:
        assert not regions
    else:
        (cut,) = regions[0].cuts
        assert (cut.axis, cut.outside) == (axis, bounds.get("outside", False))
        assert cut.low == pytest.approx(bounds.get("low", 0.0), abs=0.07)
        assert cut.high == pytest.approx(bounds.get("high", 1.0), abs=0.07)
        assert regions[0].rate.median > 0.7
        assert regions[0].outside.median < 0.15
    if half is None:
        assert better is None or better.failed < better.failed_before
    else:
        assert better
        assert better.half == module.Cut(axis, **half)
        assert better.failed <= better.failed_before


@pytest.mark.slow
def test_failures_by_chance_have_no_region():
    region_count = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        region_count += len(
            module.regions(space(*"abcdefg"), rng.random((64, 7)), rng.random(64) < 0.3)
        )
    assert region_count <= 1


def test_an_axis_of_chance_bounds_no_region_and_is_not_improved():
    shares = np.random.default_rng(0).random((256, 2))
    axes = space("a", module.CHANCE)
    assert not module.regions(axes, shares, shares[:, 1] > 0.5)
    values = 1.0 + 5.0 * shares[:, 0] + 9.0 * shares[:, 1]
    better = module.improvement(axes, shares, values, np.zeros(256, bool))
    assert better
    assert better.half == module.Cut(0, high=0.5)


def test_the_improvement_is_told_by_the_half_that_did_not_choose_it():
    shares = np.random.default_rng(1).random((400, 2))
    # better above, in the half that tells
    values = np.where(np.arange(400) < 200, shares[:, 1], 2.0 - shares[:, 1])
    assert module.improvement(space("a", "b"), shares, values, np.zeros(400, bool)) is None


def test_a_run_is_a_plain_scenario_and_an_axis_that_acts_on_nothing_has_the_index_0():
    """Without a command no bound on it acts; and every score is that of a scenario which anybody
    can run again.
    """
    base = scenario(law="none", plant="van_der_pol")
    over = smc.Uncertainty(mass=(0.5, 2.0), bound=(0.2, 1.0))
    result, alone = (
        smc.sensitivity(
            base,
            over,
            points=16,
            threads=threads,
        )
        for threads in (None, 1)
    )
    indices = {axis.name: axis for axis in result.axes}
    assert indices["mass"].total.median > 0.8
    assert indices["bound"].total[:3] == indices["bound"].first[:3] == (0.0, 0.0, 0.0)
    np.testing.assert_array_equal(result.values, alone.values)
    row = result.space.scenario_at(result.shares[5])
    assert (
        row.mismatch["mass"]
        == result.space.column(result.space.names.index("mass"), result.shares)[5]
    )
    assert smc.score(smc.run(row))["rms_error"] == result.values[5]
    assert result.runs == 16 * 4


def test_a_run_fails_where_its_force_is_too_small_and_one_without_a_score_has_the_worst():
    base = scenario(plant="inverted_pendulum", law=smc.law("observer_free"), duration=4.0)
    result = smc.sensitivity(
        base,
        smc.Uncertainty(bound=(0.05, 1.0)),
        "settling_time",
        points=16,
    )
    bounds = result.space.column(0, result.shares)
    assert 0 < result.failed.sum() < 16
    assert bounds[result.failed].max() < bounds[~result.failed].min()
    worst = result.values[result.failed]
    assert math.isfinite(result.values.max())
    assert (worst == result.values.max()).all()


def test_the_share_that_says_whether_a_run_ends_at_rest_may_be_the_metric():
    case = scenario(law=smc.law("boundary_layer"), duration=3.0)
    result = smc.sensitivity(case, smc.Uncertainty(bound=(0.02, 1.0)), "rest_share", points=16)
    assert 0 < result.failed.sum() < 16
    assert (result.failed == (result.values > 0.05)).all()


def test_levels_and_chance_are_axes():
    """A level scales the force and the errors that chance draws; equal chances draw the same."""
    class_space = module.Space(
        scenario(), smc.Uncertainty(disturbance=2.0, position_noise=1e-3, delay=(0.0, 0.01))
    )
    assert class_space.names == ["delay", "disturbance", "noise", "chance"]
    rows = [1.0, 0.5, 0.2, 0.3], [0.0, 1.0, 0.4, 0.3], [0.0, 1.0, 0.4, 0.6]
    low, high, redraw = (class_space.scenario_at(np.array(row)) for row in rows)
    assert [drawn.input_delay for drawn in (low, high, redraw)] == [0.01, 0.0, 0.0]
    forces = [np.array(drawn.disturbance[0].values) for drawn in (low, high, redraw)]
    errors = []
    for drawn in (low, high, redraw):
        errors.append(np.array(vars(drawn.noise.position_error)["values"]))
    for half, full, redrawn in (forces, errors):
        np.testing.assert_allclose(2.0 * half, full, atol=1e-15)
        assert np.abs(full - redrawn).max() > 0.1 * np.abs(full).max()
    assert np.abs(forces[1]).max() <= 2.0
    assert np.abs(errors[1]).max() <= 0.4e-3


def test_encoder_bound_and_period_take_all_of_their_ranges():
    base = scenario(u_max=4.0, physics_step=0.5e-3)
    members = Members(
        [base], smc.Uncertainty(encoder=(256, 4096), bound=(0.5, 1.0), period=(0.4, 3.0))
    )
    low, middle, high = (members.with_constants(np.full(3, share)) for share in (0.0, 0.5, 1.0))
    assert [vars(drawn.sensor)["counts"] for drawn in (low, middle, high)] == [256, 1024, 4096]
    assert [drawn.u_max for drawn in (low, middle, high)] == [2.0, 3.0, 4.0]
    assert [drawn.control_period for drawn in (low, high)] == pytest.approx([0.5e-3, 3e-3])
    assert {drawn.physics_step for drawn in (low, middle, high)} == {0.5e-3}
    biased = dataclasses.replace(base, sensor=smc.Encoder(64, bias=0.1))
    assert Members([biased], smc.Uncertainty(encoder=(256, 512))).with_constants(
        np.ones(1)
    ).sensor == smc.Encoder(512, bias=0.1)
    with pytest.raises(smc.ScenarioError, match="period cannot differ: leave it out of within"):
        smc.worst_case(base, within=smc.Uncertainty(period=(1.0, 2.0)))
    with pytest.raises(smc.ScenarioError, match="give the scenario a u_max"):
        smc.sensitivity(scenario(u_max=math.inf), smc.Uncertainty(bound=(0.5, 1.0)))


def test_a_jitter_keeps_the_delays_of_a_fine_step_and_an_axis_of_one_value_is_refused():
    fine = scenario(physics_step=5e-5)  # 20 steps a sample, no multiple of 8
    members = Members([fine], smc.Uncertainty(delay=(0.0, 0.00255), jitter=5e-4))
    assert members.with_constants(np.ones(2)).input_delay == pytest.approx(0.00255)
    with pytest.raises(smc.ScenarioError, match="give a range with several"):
        smc.sensitivity(scenario(physics_step=1e-3), smc.Uncertainty(period=(0.9, 1.1)))


def test_the_default_class_has_the_axes_of_machines():
    class_space = module.Space(base := scenario(), default_class(base))
    assert set(class_space.names) == {
        "mass",
        "friction",
        "delay",
        "noise",
        "encoder",
        "bound",
        "period",
        "chance",
    }
    assert default_points(scenario(duration=0.01), 8) == 512
    assert default_points(scenario(duration=8.0), 8) == 32
    assert default_points(scenario(duration=5.0), 8) == 64
    assert default_points(scenario(plant="panda", law="computed_torque", duration=10.0), 8) == 8


def test_scores_that_only_mixed_points_tell_apart_explain_nothing_and_no_index_is_above_1():
    designs = module.designs(16, 2, 0)
    scores = np.ones(64)
    scores[40] = 2.0
    axes = module.indices(space("a", "b"), scores, 16, designs[:32], scores[:32], 0)
    assert {axis.total[:3] for axis in axes} == {(0.0, 0.0, 0.0)}
    cliff = (designs[:, 0] > 0.9) + 0.1 * designs[:, 1]
    [steep, _] = module.indices(space("a", "b"), cliff, 16, designs[:32], cliff[:32], 0)
    assert 0.0 <= steep.total.low <= steep.total.high <= 1.0


def test_runs_without_a_score_are_counted_and_too_many_are_not_explained():
    base = scenario(plant="inverted_pendulum", law=smc.law("observer_free"), duration=1.0)
    over = smc.Uncertainty(bound=(0.05, 1.0))
    with pytest.raises(
        smc.ScenarioError,
        match="no run of 48 has a settling_time: give longer runs, another metric",
    ):
        smc.sensitivity(
            dataclasses.replace(base, duration=0.1),
            over,
            "settling_time",
            points=16,
        )
    result = smc.sensitivity(
        dataclasses.replace(base, duration=4.0), over, "settling_time", points=16
    )
    assert 0 < result.unscored < 16
    assert f"; {result.unscored} have none, and count as the worst" in result.sentences[1]
    many = dataclasses.replace(result, unscored=20)
    assert many.sentences[0].startswith("explains: no axis")


def test_a_broken_law_is_named():
    @smc.law_function(gains={"k": 1.0})
    def broken(y, gains, memory):
        if y.e < 1e9:
            raise RuntimeError("boom")
        return -y.e, y.e

    with pytest.raises(
        smc.ScenarioError, match=r"no run of 24 has a rms_error: .*boom.*: correct the law"
    ):
        smc.sensitivity(scenario(law=broken), smc.Uncertainty(mass=(0.5, 2.0)), points=8)


def test_one_axis_is_named_only_if_the_intervals_part():
    over = smc.Uncertainty(mass=(0.5, 2.0), bound=(0.2, 1.0))
    result = smc.sensitivity(scenario(law="none"), over, points=16)
    assert result.sentences[0].startswith("explains: mass, ")
    total = result.axes[0].total
    first = result.axes[0]._replace(total=total._replace(low=0.8))
    reached = result.axes[1]._replace(total=total._replace(median=0.0, low=0.0, high=0.9))
    same = dataclasses.replace(result, axes=(first, reached))
    assert same.sentences[0].startswith("explains: open")
    assert "no axis" in dataclasses.replace(result, values=np.ones(32)).sentences[0]
    partly_failed = dataclasses.replace(result, failed=np.arange(32) < 5, regions=())
    assert partly_failed.sentences[2].startswith("fail: 5 of 32 runs (")
    none_failed = dataclasses.replace(result, failed=np.zeros(32, bool), regions=())
    assert none_failed.sentences[2].startswith("fail: 0 of 32 runs (")


def test_what_cannot_be_answered_is_refused():
    over = smc.Uncertainty(mass=(0.7, 1.3))
    for case, fields, sentence in [
        (scenario(), {"points": 33}, "points is 33: give a power of 2, such as 32"),
        (scenario(), {"within": 3}, "within is 3: give a class"),
        ("duffing", {}, "sensitivity is of a Scenario, not 'duffing'"),
        (scenario(), {"metric": "speed"}, "metric"),
    ]:
        with pytest.raises(smc.ScenarioError, match=sentence):
            smc.sensitivity(case, **{"within": over} | fields)


@pytest.mark.slow
def test_with_many_runs_the_fast_engine_makes_them_and_mujoco_repeats_some(monkeypatch):
    within = smc.Uncertainty(mass=(0.7, 1.3), friction=(0.0, 0.3), delay=(0.0, 0.01))
    case = scenario(law=smc.law("boundary_layer"), duration=1.0)
    expected = smc.sensitivity(case, within, points=8)
    monkeypatch.setattr(scored_runs, "MIN_WORK", 0)
    result = smc.sensitivity(case, within, points=8)
    assert result.values == pytest.approx(expected.values, rel=1e-9)
    assert (result.failed == expected.failed).all()
    assert "MuJoCo repeated 20 runs of another engine: 0 failed" in str(result)
    assert not expected.checked
