"""A Scenario takes what makes sense and refuses the rest with one sentence that names the field and
the value.
"""

import dataclasses
import math
import pickle
from fractions import Fraction

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.simulation.signals import PerChannel, Relay

pytestmark = pytest.mark.quick

NAN = math.nan
INF = math.inf
COME = smc.Step(1.0)


def scenario(**fields):
    return smc.Scenario(
        **{"plant": "duffing", "law": smc.law("classical"), "duration": 1.0} | fields
    )


def brief(value) -> str:
    """A test's name for a value."""
    return repr(value)[:20]


NO_NUMBERS = [
    True,
    None,
    "1",
    "fast",
    b"1",
    [],
    [1.0],
    {},
    (1.0, 2.0),
    1 + 2j,
    np.bool_(True),
    np.array([1.0]),
    ...,
]


def test_a_bound_is_none_one_number_or_one_a_channel(refused):
    assert scenario(u_max=None) == scenario(u_max=6.0) == scenario()
    for value in NO_NUMBERS:
        if isinstance(value, list | tuple | np.ndarray) and len(value) == 1:
            assert scenario(u_max=value) == scenario(u_max=float(value[0]))
        elif value is not None:
            refused(lambda value=value: scenario(u_max=value), "u_max")


def test_a_field_out_of_its_range_is_refused(refused):
    for field in ["u_max", "input_delay", "physics_step"]:
        for value in (NAN, -INF, -1.0, *(() if field == "u_max" else (INF,))):
            refused(
                lambda value=value, field=field: scenario(**{field: value}), field, f"{value:g}"
            )
        for value in () if field == "input_delay" else (0, -0.0):
            refused(
                lambda value=value, field=field: scenario(**{field: value}), field, "greater than 0"
            )
        if field != "u_max":
            refused(lambda field=field: scenario(**{field: 10**400}), field)


@pytest.mark.parametrize(
    "number", [np.float64(0.5), np.float32(0.5), np.array(0.5), Fraction(1, 2)], ids=brief
)
def test_anything_that_is_a_number_is_taken_as_a_float(number):
    for field in ("duration", "control_period", "u_max", "input_delay", "x0", "v0"):
        value = getattr(scenario(**{field: number}), field)
        assert value in (0.5, (0.5,))
        assert type(value[0] if isinstance(value, tuple) else value) is float


@pytest.mark.filterwarnings("ignore:control_period is")
@pytest.mark.filterwarnings("ignore:duration")
def test_the_physics_step_is_the_largest_divisor_up_to_a_millisecond():
    for period, step, steps in (
        (1e-3, 1e-3, 1),
        (1e-2, 1e-3, 10),
        (5e-4, 5e-4, 1),
        (1.5e-3, 7.5e-4, 2),
        (1 / 300, 1 / 1200, 4),
        (0.1, 1e-3, 100),
        (100.0, 1e-3, 100_000),
    ):
        stepped = scenario(control_period=period, duration=100.0)
        assert stepped.resolved.physics_step == pytest.approx(step, rel=1e-12)
        assert stepped.steps == steps


def test_a_duration_that_is_no_whole_number_of_periods_is_named_with_what_is_run():
    with pytest.warns(smc.errors.ScenarioWarning, match="so the run lasts 0.09 s: give .* 0.12"):
        scenario(duration=0.1, control_period=0.03)


@pytest.mark.filterwarnings("ignore:control_period is", "ignore:duration")
def test_a_run_lasts_the_whole_periods_that_fit():
    for duration, period, samples in (
        (1.0, 1e-3, 1000),
        (0.3, 0.1, 3),
        (0.35, 0.1, 3),
        (10.0, 3.0, 3),
        (1e-3, 1e-3, 1),
        (0.7, 0.07, 10),
    ):
        assert scenario(duration=duration, control_period=period).samples == samples


def test_a_physics_step_that_does_not_divide_the_period_is_refused(refused):
    for step in [2e-3, 3e-4, 0.9e-3, 1.0, 1e-3 / 1.5]:
        refused(lambda step=step: scenario(physics_step=step), "physics_step", f"{step:g}", "0.001")


def test_one_parameter_under_two_names_is_refused(refused):
    for name in ["duffing", "pendulum_network"]:
        plant = smc.plant(name)
        masses = {"mass": 1.2, plant.mass: 1.5}
        words = (
            f"{plant.mass} 1.5 and mass 1.2, which are the same parameter of {name}: give one of "
            "them"
        )
        for fields, said in (
            ({"mismatch": masses}, "mismatch has"),
            ({"jump": smc.Jump(0.5, masses)}, "Jump has"),
        ):
            refused(lambda fields=fields, plant=plant: scenario(plant=plant, **fields), said, words)
        # in turn
        apart = scenario(plant=name, mismatch={"mass": 1.2}, jump=smc.Jump(0.5, {plant.mass: 1.5}))
        mass = getattr(plant.values(apart.factors(10**6)), plant.mass)
        assert mass == pytest.approx(1.8 * plant.parameters[plant.mass])


@pytest.mark.parametrize("count", [1, 3, 7, 1000])
def test_a_physics_step_that_divides_up_to_rounding_divides_exactly(count):
    stepped = scenario(control_period=1e-2, physics_step=1e-2 / count * (1 + 1e-12))
    assert stepped.steps == count
    assert stepped.resolved.physics_step == 1e-2 / count


def test_a_delay_that_is_no_whole_number_of_steps_is_refused(refused):
    for delay in [1e-4, 1.5e-3, 0.0107]:
        refused(
            lambda delay=delay: scenario(input_delay=delay), "input_delay", f"{delay:g}", "0.001"
        )


def test_a_state_of_the_wrong_length_is_refused(refused):
    plant = smc.plant("pendulum_network", n=3)
    for field in ("x0", "v0"):
        for value in (
            [],
            np.zeros((10, 10)),
        ):
            words = f"{len(value)} values", "3 channels"
            refused(
                lambda value=value, field=field: scenario(plant=plant, **{field: value}),
                field,
                *words,
            )
        # is not made a list
        refused(lambda field=field: scenario(**{field: range(10**9)}), field, "more than")


def test_a_state_is_one_number_or_one_a_channel():
    for value in (
        0.5,
        [0.5],
        [np.float32(0.5)] * 3,
        np.array(0.5),
    ):
        network = scenario(plant=smc.plant("pendulum_network", n=3), x0=value, v0=value)
        assert network.resolved.x0 == network.resolved.v0 == (0.5, 0.5, 0.5)


def test_by_default_the_plant_starts_at_rest_where_the_paper_puts_it():
    pendulum = scenario(plant="inverted_pendulum")
    assert pendulum.resolved.x0 == smc.plant("inverted_pendulum").x0
    assert pendulum.resolved.v0 == (0.0,)


@pytest.mark.parametrize("n", [2, 5, 12])
def test_a_network_recycles_the_paper_s_initial_positions(n):
    first = smc.plant("pendulum_network").x0
    assert len(first) == 5
    network = scenario(plant=smc.plant("pendulum_network", n=n))
    assert network.resolved.x0 == tuple(first[i % 5] for i in range(n))


def test_an_unknown_name_suggests_the_nearest(refused):
    for make, wrong, near in (
        (lambda: scenario(plant="dufing"), "dufing", "duffing"),
        (lambda: scenario(plant="pendulum_netwrok"), "pendulum_netwrok", "pendulum_network"),
        (lambda: scenario(law="super_twistin"), "super_twistin", "super_twisting"),
        (lambda: scenario(velocity="measure"), "measure", "measured"),
        (lambda: scenario(mismatch={"alpah": 2.0}), "alpah", "alpha"),
        (lambda: scenario(jump=smc.Jump(0.5, {"detla": 2.0})), "detla", "delta"),
        (lambda: smc.law("observer_free", lamb=2.0), "lamb", "lam"),
        (lambda: smc.plant("duffing", betta=2.0), "betta", "beta"),
        (lambda: smc.estimator("filtered_difference", taw=2.0), "taw", "tau"),
    ):
        message = refused(make, repr(wrong))
        assert f"did you mean '{near}'" in message


def test_a_disturbance_is_none_one_or_several():
    sine = smc.Sine(1.0, 2.0)
    assert scenario(disturbance=None).disturbance == scenario(disturbance=[]).disturbance == ()
    assert scenario(disturbance=sine).disturbance == (sine,)
    assert scenario(disturbance=[sine, smc.Constant(1.0)]).disturbance == (sine, smc.Constant(1.0))


def test_a_disturbance_by_joint_is_refused_and_the_fault_that_it_names_acts_there(refused):
    plant = smc.plant("double_pendulum")
    push = {"elbow": smc.Sine(1.0, 2.0)}
    words = refused(lambda: scenario(plant=plant, disturbance=push), "every driven joint")
    refused(lambda: scenario(plant="duffing", disturbance=push), "unknown joint of duffing")
    fault = eval(words.partition("fault=")[2].replace("...", "0.2"))
    assert fault.on == "elbow"
    assert scenario(plant=plant, fault=fault).fault == fault


def test_an_error_of_measurement_is_a_known_signal(refused):
    for error in (
        0.1,
        smc.signals.OrnsteinUhlenbeck(0.1, 1.0),
        smc.signals.Gust(1.0, 0.0, 1.0),
        Relay(1.0),
        PerChannel((COME,)),
    ):
        refused(lambda error=error: smc.Noise(velocity_error=error), f"error is {error!r}"[:30])
        refused(lambda error=error: smc.Noise(position_error=error), f"error is {error!r}"[:30])


def test_a_push_is_on_a_body_that_has_a_name(refused):
    refused(lambda: scenario(disturbance=smc.signals.Push(3)), "body", "Push 3")


def test_a_plant_keeps_a_positive_mass(refused):
    for name, value in [
        ("mass", 0.0),
        ("M", -1.0),
    ]:
        refused(lambda name=name, value=value: scenario(mismatch={name: value}), name, f"{value:g}")
        refused(
            lambda name=name, value=value: scenario(jump=smc.Jump(0.5, {name: value})),
            name,
            f"{value:g}",
        )


def test_factors_that_together_leave_no_mechanism_are_refused(refused):
    for fields in [
        {"mismatch": {"mass": 1e-200, "M": 1e-200}},
        {"mismatch": {"mass": 1e-200}, "jump": smc.Jump(0.5, {"mass": 1e-200})},
        {"mismatch": {"alpha": 1e300}, "jump": smc.Jump(0.5, {"alpha": 1e300})},
    ]:
        refused(lambda fields=fields: scenario(**fields), "duffing")


def test_mass_means_the_plant_s_mass():
    assert vars(smc.plant("duffing").values({"mass": 2.0}))["M"] == 2.0
    assert vars(smc.plant("pendulum_network").values({"mass": 2.0}))["m"] == 1.0


def test_a_jump_after_the_end_is_refused(refused):
    for time in (1.0, 1.5, 1e300):
        refused(
            lambda time=time: scenario(duration=1.0, jump=smc.Jump(time, {"M": 2.0})),
            "jump",
            f"{time:g}",
        )


def test_a_network_s_size_is_a_whole_number_in_its_range(refused):
    for n in (
        1,
        0,
        -3,
        1001,
        2.5,
        NAN,
        INF,
        None,
        "3",
        "many",
        [3],
        np.array([2, 3]),
    ):
        refused(lambda n=n: smc.plant("pendulum_network", n=n), "pendulum_network", "n")


def full():
    return scenario(
        plant=smc.plant("pendulum_network", n=3, m=0.4),
        law=smc.law("super_twisting", k1=1.0),
        velocity=smc.estimator("filtered_difference", tau=1e-2),
        control_period=2e-3,
        reference=smc.Sine(0.1, 2.0),
        disturbance=[
            smc.signals.OrnsteinUhlenbeck(0.1, 0.1),
            smc.signals.Pulse(1.0, 0.1, 0.2),
            smc.Step(1.0, 0.5),
        ],
        noise=smc.Noise(0.01, 0.05),
        input_delay=3e-3,
        mismatch={"mass": 1.3},
        jump=smc.Jump(0.5, {"kc": 2.0}),
        seed=7,
        integrator="Euler",
        u_max=INF,
    )


THINGS = [full(), smc.Noise(0.1), smc.Jump(0.5, {"M": 2.0}), smc.estimator("measured")]
THINGS += [smc.plant(name) for name in smc.plants()] + [smc.law(name) for name in smc.laws()]


# laws, models, surfaces


def test_a_law_of_the_error_and_its_rates_takes_no_surface(refused):
    for law in ["twisting", "nested_third_order", "pid"]:
        refused(lambda law=law: scenario(law=law, surface="linear"), f"'{law}'", "'linear'")


def test_a_law_that_cannot_do_without_the_model_gets_it_unless_told_otherwise():
    without = smc.Scenario(plant="cart_pole", law="hierarchical")
    assert without.resolved.model == "nominal"
    assert (
        smc.Scenario(plant="cart_pole", law="hierarchical", model="none").resolved.model == "none"
    )
    assert dataclasses.replace(without, law=smc.law("classical")).resolved.model == "none"


def test_a_law_for_other_plants_is_refused(refused):
    refused(lambda: scenario(plant="duffing", law="swing_up"), "'swing_up'", "inverted_pendulum")


def test_a_missed_condition_warns_once_where_it_was_written():
    with pytest.warns(smc.errors.GainWarning, match="r1 > r2") as caught:
        law = smc.law("twisting", r1=1.0, r2=2.0)
    assert [w.filename for w in caught] == [__file__]
    again = pickle.loads(pickle.dumps(law))  # and not again
    assert again == law


@pytest.mark.filterwarnings("ignore:(input_delay|control_period) is")
def test_the_field_s_usual_words_are_understood(refused):
    for word, meant in (
        ("STA", "super_twisting_attitude"),
        ("CTA", "continuous_twisting"),
        ("ISMC", "integral"),
    ):
        refused(lambda word=word: smc.Scenario(plant="duffing", law=word), f"'{meant}'?")
    refused(lambda: smc.Scenario(plant="duffing", law="STA"), "'super_twisting' or")
    refused(
        lambda: smc.Scenario(plant="duffing", law=smc.law("pid"), reference=0.5), "reference is 0.5"
    )


def test_what_belongs_elsewhere_is_sent_there(tmp_path, refused):
    scenario = smc.Scenario(plant="duffing", law=smc.law("pid"), duration=0.01)
    refused(lambda: smc.margins(scenario), "margins")  # pyright: ignore[reportArgumentType]
    refused(lambda: smc.plot(smc.run(scenario)), "Trace(", "smc.figure")  # pyright: ignore[reportArgumentType]
    refused(lambda: smc.figure(smc.study([scenario], tmp_path)), "no trace")  # pyright: ignore[reportArgumentType]


def test_a_period_that_would_need_countless_default_steps_is_refused_at_once(refused):
    for word, field in {
        "1e+306 s": {"control_period": 1e306},
        "1e-310 s": {"clock": smc.Clock(1e-310)},
    }.items():
        refused(
            lambda field=field: smc.run(
                smc.Scenario(
                    plant="duffing",
                    law="none",
                    duration=0.01,
                    actuator=[smc.Lag(0.01)],
                    **field,
                )
            ),
            word,
        )


@pytest.mark.parametrize(
    ("plant", "x0", "words"),
    [
        ("duffing", [0.1, 0.2], "2 values, and duffing 1 channel: give one number$"),
        ("cart_pole", [0.1] * 3, "3 values, and cart_pole 2 channels: give one number, or 2$"),
    ],
)
def test_a_start_of_another_size_names_the_sizes_that_there_are(plant, x0, words):
    for name in ("x0", "v0"):
        with pytest.raises(smc.ScenarioError, match=f"^{name} has {words}"):
            smc.Scenario(plant=plant, law="none", **{name: x0})


@pytest.mark.parametrize("given", [5, 0.5, None, "duffing", np.array(1.0), np.timedelta64(1, "s")])
def test_what_is_no_scenario_is_refused_by_run_and_stream_alike(given, refused):
    refused(lambda: smc.run(given), "give smc.Scenario(")
    refused(lambda: list(smc.stream(given)), "give smc.Scenario(")


@pytest.mark.parametrize(
    ("make", "meant"),
    [
        (lambda: smc.Scenario(plant="duffing", delay=0.02), "'input_delay'"),
        (lambda: smc.Scenario(plant="duffing", controller="pid"), "'law'"),
        (lambda: smc.Scenario(plant="duffing", dt=0.01), "'control_period'"),
        (lambda: smc.Scenario(system="duffing"), "'plant'"),
        (
            lambda: dataclasses.replace(smc.Scenario(plant="duffing", law=smc.law("pid")), noize=1),
            "'noise'",
        ),
        (lambda: smc.Uncertainty(delai=(0.0, 0.01)), "'delay'"),
    ],
)
def test_a_field_that_there_is_not_suggests_the_one_that_is_meant(make, meant):
    with pytest.raises(TypeError, match=f"unexpected keyword argument .*: did you mean {meant}"):
        make()


def test_a_generator_draws_a_seed():
    draws = [
        smc.Scenario(plant="duffing", law="pid", seed=np.random.default_rng(seed)).seed
        for seed in (1, 1, 2)
    ]
    assert draws[0] == draws[1] != draws[2]
    assert all(type(seed) is int for seed in draws)


def test_a_model_s_file_is_no_name_of_a_plant(refused):
    refused(lambda: smc.plant("arm.xml:elbow"), "arm.xml:elbow", "plant_from")
