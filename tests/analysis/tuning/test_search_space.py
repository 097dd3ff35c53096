"""Units of gains: a law whose gains are converted by their units does the same in every system of
units.

The plant is x'' = f + g u (with one integrator more for laws of degree 3), in units of force,
position and time and again in others; gains, forces, positions and times are converted. Laws that
have a number with a unit in their formula are held to the systems in which this number is the same.
"""

import dataclasses
import math

import numpy as np
import pytest
from helpers.plants_ab import plant_b, plant_c

import smc_mujoco as smc
from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.control import gain_sets, units
from smc_mujoco.control.law import law_catalogue
from smc_mujoco.control.law import library_law as find_law

ALONE = dict.fromkeys(
    ("hierarchical", "rotary_swing_up"),
    "its plants have a free joint, and `search_space.scales` refuses them",
)
LAWS = [name for name in law_catalogue() if name not in ALONE]

# Numbers with a unit in the formulas, which no gain states.
G_IS_1 = (units.INERTIA, "takes an acceleration for a force, as it has no model and g counts as 1")
TANH = (units.SPEED, "the width of tanh is 1 in s")
FIXED = {
    "barrier_adaptive": (units.FORCE, "K = |s| / (eps - |s|) is a force"),
    "nested_third_order": (units.POSITION, "the powers of e and de are added"),
    "observer_free_third": (units.ACCELERATION, "the width of tanh is 1 in s"),
} | {
    name: TANH
    for name in LAWS
    if name.startswith("observer_free") and name != "observer_free_third"
}
WITHOUT_MODEL = dict.fromkeys(
    (
        "discrete_time",
        "integral",
        "nonsingular_fast_terminal",
        "nonsingular_terminal",
        "prescribed_time",
        "terminal",
    ),
    G_IS_1,
)


# so that they act in a run as short as these
VISIBLE = {
    "N": 5.0,
    "least": 3.0,
    "bound": 0.3,
    "w_max": 0.5,
    "v0": 0.2,
}


def systems(law, fixed, model, rng):
    """Systems of units in which a unit is 1; with the model laws speak in accelerations.

    They are powers of 4, so that roots are exact and rounding, which a switching law magnifies, is
    the same.
    """
    scales = []
    while len(scales) < 2:
        F, X, T = 4.0 ** rng.integers(-2, 3, 3)
        system = {
            "F": X / T ** max(law.relative_degree, 2) if model else F,
            "X": X,
            "T": T,
        }
        if (fixed is None or fixed.of(system) == 1.0) and (X, T) != (1.0, 1.0):
            scales.append((system, F))
    return scales


def run(law, X=1.0, T=1.0, F=1.0, model=0.0):
    """x / X and u / F over 150 samples, in a system of units."""
    if law.relative_degree == 3:
        plant = plant_c
        n = 3
    else:
        plant = plant_b
        n = 2
    start = []
    for i, value in enumerate((1.0, 0.4, -0.2)[:n]):
        start.append(value * X / T**i)
    done = plant(
        law,
        x=start,
        h=0.01 * T,
        duration=1.5 * T,
        f=-0.3 * X / T**n,
        g=2.0 * X / (T**n * F),
        limit=3.0 * F,
        model=model,
        speed=-0.25 * X / T,
    )
    return done.x[:, 0] / X, done.u / F


def given(name, rng):
    """The law with gains near its own; a gain of 0 or inf, which has no unit, is given a size."""
    law = law_catalogue()[name].bind({})
    law = dataclasses.replace(
        law, gains={gain: VISIBLE.get(gain, value) for gain, value in law.gains.items()}
    )
    exact = {gain for gain in law.gains if search_space.unit(law, gain) is None}
    sized = {}
    for gain, value in law.gains.items():
        if gain in exact:
            sized[gain] = value
        else:
            sized[gain] = rng.uniform(0.8, 1.25) * (
                value if value and math.isfinite(value) else 0.7
            )
    return dataclasses.replace(law, gains=sized)


def converted(law, system):
    """The law with its gains in another system of units."""
    gains = {}
    for gain in law.gains:
        gains[gain] = search_space.unit(law, gain) or units.Unit()
    return dataclasses.replace(
        law, gains={g: v * gains[g].of(system) for g, v in law.gains.items()}
    )


@pytest.mark.parametrize("name", [name for name in LAWS if name != "swing_up"])
def test_a_law_does_the_same_in_every_system_of_units(name):
    rng = np.random.default_rng(sum(map(ord, name)))
    law = given(name, rng)
    for model in (0.0, 1.0):
        check_units(name, law, model, rng)


def check_units(name, law, model, rng):
    x, u = run(law, model=model)
    assert np.abs(np.diff(x)).max() > 1e-3  # it moves
    fixed, _ = FIXED.get(name) or (WITHOUT_MODEL.get(name) if model == 0.0 else None) or (None, "")
    for system, force in systems(law, fixed, model, rng):
        other_x, other_u = run(converted(law, system), system["X"], system["T"], force, model)
        np.testing.assert_allclose(other_x, x, rtol=0, atol=1e-9, err_msg=str(system))
        np.testing.assert_allclose(other_u, u, rtol=0, atol=1e-6, err_msg=str(system))


@pytest.mark.quick
def test_every_gain_has_a_unit_and_a_law_with_gains_can_be_tuned():
    for name in LAWS:
        law = smc.law(name)
        for gain in law.gains:
            assert search_space.unit(law, gain) or law_catalogue()[name].gains[gain].held, name
        if name != "none":
            assert search_space.box(
                law,
                {
                    "F": 6.0,
                    "X": 1.5,
                    "M": 1.0,
                    "T": 0.5,
                },
            ), name


def test_a_unit_follows_the_exponent_that_a_law_was_given():
    scales = {
        "F": 6.0,
        "X": 2.0,
        "M": 1.0,
        "T": 0.5,
    }
    for a in (0.25, 0.75):
        low, high = search_space.box(smc.law("power_rate", a=a), scales)["k"]
        assert math.sqrt(low * high) == pytest.approx(6.0 / (2.0 / 0.5) ** a)


@pytest.mark.parametrize("name", [name for name in LAWS if name != "swing_up"])
def test_a_wrong_unit_of_any_gain_would_be_seen(name):
    law = given(name, np.random.default_rng(0))
    plain = np.concatenate([np.concatenate(run(law, model=model)) for model in (0.0, 1.0)])
    for gain, value in law.gains.items():
        doubled = dataclasses.replace(law, gains=dict(law.gains) | {gain: 2.0 * value})
        changed = np.concatenate(
            [np.concatenate(run(doubled, model=model)) for model in (0.0, 1.0)]
        )
        assert np.abs(changed - plain).max() > 1e-6, gain


def test_of_shipped_gains_only_those_of_lqi_end_where_the_box_is_open_now():
    """docs/run_study.md says so: they were searched in the box without its further decades."""
    ended = set()
    for plant in ("duffing", "van_der_pol", "inverted_pendulum"):
        scales = search_space.scales(smc.plant(plant), 6.0)
        for name in gain_sets.general_laws([plant], "tuned"):
            opened = {}
            for gain, (low, high) in search_space.box(find_law(name), scales).items():
                before = low * 10 ** (2 * search_space.HALF_WIDTH)
                if high > 1.01 * before:
                    opened[gain] = low / 10, 10 * before  # as they were widened then
            for gains in gain_sets.tuned(plant, name).sets:
                edges = search_space.at_bound({gain: gains[gain] for gain in opened}, opened)
                ended |= {(plant, name, gain) for gain in edges if edges[gain] == "upper"}
    assert ended == {("duffing", "lqi", "q0"), ("van_der_pol", "lqi", "q0")}
