"""Predicted chattering: describing functions against closed forms, limit cycles against formulas
and against runs.
"""

import dataclasses
import itertools
import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.runs import at_defaults

import smc_mujoco as smc
from smc_mujoco.analysis.differ import relative_range
from smc_mujoco.analysis.step_halving import StepChange
from smc_mujoco.chattering.cycle_tables import cycle_rows, table
from smc_mujoco.chattering.harmonics import Loop, Wave, play
from smc_mujoco.chattering.prediction import (
    Chattering,
    _assumptions,
    cycles,
    switches,
)
from smc_mujoco.common.files import plain_data
from smc_mujoco.common.tabular import as_cell
from smc_mujoco.design import chattering
from smc_mujoco.metrics.limit_cycle import channel_cycle

COARSELY = pytest.mark.usefixtures("coarse_grid")

HALF = math.gamma(1.25) / (math.sqrt(math.pi) * math.gamma(1.75))  # of sqrt|sin| sign(sin), over 2
INTEGRATOR = {"alpha": 0.0, "beta": 0.0, "delta": 0.0}  # of a Duffing oscillator: a free mass
LAWS = {
    "classical": smc.law("classical", k=2.0, c=0.01),
    "super_twisting": smc.law("super_twisting", k1=1.5, k2=1.1, c=0.01),
}


@pytest.mark.quick
def test_a_prediction_prints_as_a_sentence():
    cycle = Chattering(amplitude=0.5, amplitude_x=0.1, amplitude_u=2.0, frequency=40.0)
    assert str(cycle).startswith("Limit cycle predicted: 40 Hz, with amplitudes 0.5 of s, 0.1 of x")
    assert str(Chattering(assumptions=("at rest",))) == "No limit cycle predicted. Note: at rest."


def lagging(law, mu, **fields):
    """An integrator of s (c is small) behind two equal lags."""
    settings = {
        "actuator": (smc.Lag(mu), smc.Lag(mu)),
        "control_period": 1e-4,
        "x0": 0.0,
        "v0": 1e-3,
    }
    return smc.Scenario(
        plant=smc.plant("duffing", **INTEGRATOR), law=at_defaults(law), **(settings | fields)
    )


def measured(trace, part=0.4):
    """Half the range of s within a period, median of all, and the frequency by its crossings, of
    the last part.
    """
    first = int(len(trace.t) * (1 - part))
    s = trace.s[first:, 0]
    t = trace.t[first:]
    z = s - s.mean()
    up = np.flatnonzero((z[:-1] < 0) & (z[1:] >= 0))
    crossings = t[up] - z[up] * (t[up + 1] - t[up]) / (z[up + 1] - z[up])
    ranges = []
    for a, b in itertools.pairwise(up):
        ranges.append(np.ptp(s[a : b + 1]))
    return np.median(ranges) / 2, (len(crossings) - 1) / (crossings[-1] - crossings[0])


# the loop


def fitted(scenario, omega):
    """First harmonic of x, complex, of a run under u = sin(omega t), after what was there at the
    start has decayed.
    """
    trace = smc.run(scenario)
    part = trace.t > 0.5 * scenario.duration
    t = trace.t[part]
    x = trace.x[part, 0]
    (real, imaginary, *_), *_ = np.linalg.lstsq(
        np.column_stack([np.cos(omega * t), np.sin(omega * t), np.ones_like(t), t]), x
    )
    return complex(imaginary, real)


@pytest.mark.slow
@pytest.mark.parametrize(
    "fields",
    [
        {"actuator": (smc.Lag(5e-3), smc.Lag(5e-3))},
        {"actuator": (smc.Lag(5e-3), smc.DCMotor(inductance=1e-3))},
        {
            "actuator": smc.Lag(0.01),
            "input_delay": 0.004,
            "control_period": 2e-3,
        },
        {"actuator": (smc.Lag(5e-3), smc.hardware.ElasticJoint(900.0, 1.0, 0.02))},
    ],
    ids=["two lags", "motor", "lag and delay", "elastic joint"],
)
def test_the_response_of_the_loop_is_that_of_a_run_under_a_sine(fields):
    omega = math.tau * 17.0
    scenario = smc.Scenario(
        plant=smc.plant("duffing", alpha=4.0, beta=0.0, delta=3.0),
        law="none",
        feedforward=smc.Sine(1.0, omega=omega),
        x0=0.0,
        v0=0.0,
        duration=14.0,
        physics_step=2e-4,
        **fields,
    )
    late = (
        omega * scenario.resolved.physics_step
    ) ** 2 / 12.0  # of positions, because forces are means over steps
    assert Loop(scenario).response(omega) == pytest.approx(fitted(scenario, omega), rel=1e-5 + late)


def test_an_encoder_on_the_motor_answers_as_the_rotor():
    """Joint over rotor is the spring's force over that of spring and joint."""
    omega, d, k = 20.0, 0.3, 90.0
    plant = smc.plant("duffing", M=1.5, alpha=4.0, beta=0.0, delta=3.0)
    joint, rotor = (
        Loop(
            smc.Scenario(
                plant=plant,
                law="none",
                actuator=smc.hardware.ElasticJoint(k, d, 0.02),
                sensor=smc.Encoder(side=side),
            )
        ).response(omega)
        for side in ("link", "motor")
    )
    spring = k + 1j * omega * d
    expected = spring / (spring + 4.0 + 3.0j * omega - 1.5 * omega**2)
    assert joint / rotor == pytest.approx(expected, rel=2e-3)


@smc.law_function(gains=dict.fromkeys(("x", "v", "f", "q", "dq", "fq"), 0.0))
def weighted(y, gains, memory):
    """Returns what it is told, each with a weight."""
    driven = gains.x * y.x + gains.v * y.v + gains.f * y.f
    return driven + gains.q * y.q + gains.dq * y.dq + gains.fq * y.fq, y.e


@pytest.mark.parametrize("name", weighted.gains)
def test_a_law_is_told_of_its_joint_of_the_one_that_this_moves_and_of_their_models(name):
    omega = 20.0
    loop = Loop(
        smc.Scenario(plant=smc.plant("furuta", b=1e-3, bq=1e-3), law=weighted(**{name: 1.0}))
    )
    answer = loop._answer(omega) / loop._answer(omega)[loop.rows[0]]
    (x, q), (v, dq) = answer[loop.rows], answer[loop.nv + loop.rows]
    (*_, fx, fv), (*_, fqx, fqv) = loop.nominal_models
    expected = {
        "x": x,
        "v": v,
        "f": fx * x + fv * v,
        "q": q,
        "dq": dq,
        "fq": fqx * q + fqv * dq,
    }
    assert loop.gain(1e-6, omega) == pytest.approx(expected[name], rel=1e-3)


@pytest.mark.parametrize(
    ("gap", "omega"),
    [
        (1e-3, 60.0),
        (5e-2, 20.0),
    ],
)
def test_the_describing_function_of_play_is_that_of_a_run_under_a_sine(gap, omega):
    scenario = smc.Scenario(
        plant=smc.plant("duffing", **INTEGRATOR),
        law="none",
        feedforward=smc.Sine(1.0, omega=omega),
        x0=0.0,
        v0=-1.0 / omega / 1.01,
        duration=4.0,
        control_period=1e-4,
        physics_step=1e-4,
        actuator=smc.Backlash(gap, rotor_inertia=0.01),
    )
    loop = Loop(scenario)
    fit = fitted(scenario, omega)
    assert loop.gap == pytest.approx(gap * 0.01 / 1.01, rel=1e-6)
    assert fit / loop.response(omega) == pytest.approx(play(abs(fit), loop.gap), abs=0.01)


@pytest.mark.parametrize("counts", [2_000])
def test_a_coarse_encoder_s_count_moves_s_as_in_a_run(counts):
    scenario = smc.Scenario(
        plant="duffing",
        law=smc.law("super_twisting"),
        actuator=smc.Lag(0.01),
        sensor=smc.Encoder(counts),
        duration=5.0,
    )
    cycle = chattering(scenario)
    trace = smc.run(scenario)
    part = trace.t > 4.0
    count = Loop(scenario).s_of_one_count
    assert count > 5.0 * cycle.amplitude
    assert np.ptp(trace.s[part, 0]) / 2 == pytest.approx(cycle.amplitude_range[1], rel=0.05)
    assert cycle.amplitude_range[1] == pytest.approx(cycle.amplitude + count, rel=0.05)
    assert math.isnan(smc.score(trace)["chattering_frequency"])  # irregular


@pytest.mark.slow
@COARSELY
@pytest.mark.parametrize("name", LAWS)
def test_amplitude_and_frequency_follow_formulas_runs_and_exponents_of_the_lag(name):
    """Perez-Ventura & Fridman 2017: s' = u behind 1/(mu s + 1)^2."""
    lags = (1e-3, 2e-2)
    cycles_of_lags = []
    for mu in lags:
        scenario = lagging(LAWS[name], mu, duration=1.0 + 40 * mu)
        cycle = chattering(scenario)
        if name == "classical":
            amplitude = 2 * mu * 2.0 / math.pi
            omega = 1 / mu
        else:
            a = 2 * HALF * 1.5
            b = 16 * 1.1 / math.pi
            amplitude = mu**2 * (a * a + b) ** 2 / (4 * a * a)
            omega = a / (mu * math.sqrt(a * a + b))
        # the formula knows no sampling
        fine = chattering(lagging(LAWS[name], mu, control_period=mu / 100))
        assert (fine.amplitude, fine.frequency) == pytest.approx(
            (amplitude, omega / math.tau), rel=0.05
        )
        assert (cycle.amplitude, cycle.frequency) == pytest.approx(
            measured(smc.run(scenario)), rel=0.05
        )
        assert cycle.power == pytest.approx(
            (cycle.amplitude * math.tau * cycle.frequency) ** 2 / 2, rel=0.05
        )
        cycles_of_lags.append(fine)
    amplitudes, frequencies = (
        np.polyfit(
            np.log(lags), np.log([getattr(predicted, quantity) for predicted in cycles_of_lags]), 1
        )[0]
        for quantity in ("amplitude", "frequency")
    )
    assert amplitudes == pytest.approx(1.0 if name == "classical" else 2.0, rel=0.02)
    assert frequencies == pytest.approx(-1.0, rel=0.02)


def test_a_relay_without_an_actuator_chatters_from_sample_to_sample():
    scenario = smc.Scenario(
        plant="inverted_pendulum",
        law=smc.law("power_rate"),
        actuator=smc.DCMotor(),
        x0=0.02,
        duration=3.0,
    )
    cycle = chattering(scenario)
    assert cycle.frequency * scenario.control_period == pytest.approx(0.5)
    assert cycle.amplitude == pytest.approx(measured(smc.run(scenario))[0], rel=0.02)


RELAY = smc.law("classical", k=4.0, c=2.5)


def test_samples_delay_a_relay_by_half_a_period_and_a_smooth_law_by_none():
    scenario = smc.Scenario(
        plant=smc.plant("duffing", **INTEGRATOR), law=RELAY, actuator=smc.Lag(0.01)
    )
    cycle = chattering(scenario)
    omega = math.tau * cycle.frequency
    late, early = Loop(scenario).phases(cycle.amplitude_x, omega)
    assert (late, early) == pytest.approx((-0.5e-3 * omega, 0.5e-3 * omega), rel=0.1)
    smooth = Loop(
        dataclasses.replace(scenario, law=smc.law("boundary_layer", k=4.0, c=2.5, phi=10.0))
    )
    assert smooth.phases(1e-3, omega) == pytest.approx((0.0, 0.0), abs=1e-3 * omega * 1e-3)


@COARSELY
@pytest.mark.parametrize("lag", [0.007, 0.03])
def test_a_relay_locked_to_the_samples_is_within_its_ranges(lag):
    scenario = smc.Scenario(
        plant="duffing",
        law=RELAY,
        actuator=smc.Lag(lag),
        x0=0.02,
        duration=6.0,
    )
    cycle, (amplitude, frequency) = chattering(scenario), measured(smc.run(scenario))
    assert cycle.uncertainty > 1.0
    assert cycle.amplitude_range[0] < amplitude < cycle.amplitude_range[1] < 2.5 * cycle.amplitude
    assert cycle.frequency_range[0] < frequency < cycle.frequency_range[1]
    assert cycle.frequency_range[0] > 0.6 * cycle.frequency


def test_a_cycle_that_the_samples_alone_hold_is_within_its_ranges_and_called_so():
    scenario = smc.Scenario(
        plant="duffing",
        law=smc.law("power_rate"),
        x0=0.02,
        duration=2.0,
    )
    cycle, (amplitude, frequency) = chattering(scenario), channel_cycle(smc.run(scenario), 0)
    assert math.isnan(cycle.amplitude)
    assert cycle.amplitude_range[0] < amplitude < cycle.amplitude_range[1]
    assert cycle.frequency_range[0] < frequency < cycle.frequency_range[1] * (1.0 + 1e-9)
    assert cycle.assumptions[-1].endswith("a cycle locked to the samples is possible")


def test_each_part_that_a_prediction_leaves_out_is_said_and_no_other():
    parts = {
        "actuator": {"rate limit": (smc.hardware.RateLimit(50.0),), "play": (smc.Backlash(0.02),)},
        "friction": {"friction": smc.Coulomb(0.1)},
        "sensor": {"encoder": smc.Encoder(counts=4096)},
    }
    plain = _assumptions(Loop(smc.Scenario(plant="inverted_pendulum", law=smc.law("classical"))))
    for field, kinds in parts.items():
        for word, part in kinds.items():
            run = smc.Scenario(
                plant="inverted_pendulum",
                law=smc.law("classical"),
                physics_step=2.5e-4,
                **{field: part},
            )
            said = " ".join(
                assumption for assumption in _assumptions(Loop(run)) if assumption not in plain
            )
            other_words = {word_of_part for words in parts.values() for word_of_part in words} - {
                word
            }
            assert word in said
            assert not [other_word for other_word in other_words if other_word in said]


def test_a_file_of_predictions_has_what_was_predicted_and_measured(snapshot):
    run = smc.Scenario(plant="duffing", law=smc.law("classical", k=2.0, c=3.0))
    sure = Chattering(
        amplitude=0.5,
        amplitude_x=0.1,
        amplitude_u=2.0,
        frequency=20.0,
        power=3.0,
        third_harmonic=0.01,
        amplitude_range=(0.25, 0.6),
        frequency_range=(18.0, 21.0),
        coupling=0.0,
        gain=1.0 - 2.0j,
        response=0.25 + 0.5j,
        assumptions=("about rest",),
    )
    possible = Chattering(amplitude_range=(0.0, 0.6), frequency_range=(18.0, 21.0))
    changes = StepChange(0.02, 0.2), StepChange(0.0, math.inf)
    measured = [(0.4, 19.0), (math.nan, math.nan)]
    said = []
    for row in cycle_rows([run, run], [sure, possible], measured, changes):
        said.append(json.dumps(plain_data(row)))
    assert [*said, bool(sure), bool(possible), *(row.marked for row in changes)] == snapshot


@pytest.mark.quick
@pytest.mark.parametrize(("plant", "share"), [("duffing", "1 %"), ("double_pendulum", "30 %")])
def test_a_table_has_what_was_predicted_beside_what_was_measured(plant, share):
    run = smc.Scenario(plant=plant, law=smc.law("classical", k=2.0, c=3.0))
    sizes = {"amplitude": 0.5, "frequency": 20.0, "third_harmonic": 0.01, "coupling": 0.3}
    ranges = {"amplitude_range": (0.4, 0.6), "frequency_range": (18.0, 21.0)}
    drawn = table([run], 0, [Chattering(**sizes, **ranges)], [(0.4, 19.0)], [StepChange(0.0, 0.0)])
    texts = [as_cell(cell).text for cell in drawn.rows[0]]
    assert texts == ["classical", "0.500", "0.400", "20.0", "19.0", "20 %", share]
    assert [heading.split()[-2] for heading in drawn.headings[1:3]] == ["predicted", "measured"]
    assert [heading.split()[0] for heading in drawn.headings[3:5]] == ["predicted", "measured"]


class Formula:
    """A loop whose law has a describing function in closed form: -K / (j w (1 + j w / p)^2), whose
    phase turns at p.
    """

    scenario = SimpleNamespace(control_period=1e-3)

    def __init__(self, law, size, turn):
        self.law = law
        self.size = size
        self.turn = turn

    def gain(self, amplitude, omega, max_samples=1000):
        return complex(-self.law(amplitude))

    def response(self, omega):
        return self.size / (1j * omega * (1.0 + 1j * omega / self.turn) ** 2)

    def wave(self, amplitude, omega):
        nothing = {
            "third": math.nan,
            "s": amplitude,
            "u": 0.0,
            "rate": 0.0,
            "drift": 0.0,
        }
        return Wave(
            amplitude=amplitude,
            omega=omega,
            gain=self.gain(amplitude, omega),
            **nothing,
        )


def saturated(k, width, a):
    """Of k sat(s / width)."""
    share = min(width / a, 1.0)
    return 2 * k / (math.pi * width) * (math.asin(share) + share * math.sqrt(1 - share**2))


def saturation(a):
    return saturated(1.0, 1.0, a)


def relay(a):
    return 4.0 / (math.pi * a)


def relay_with_a_dead_zone(a):
    if a > 0.01:
        return relay(a) * math.sqrt(1.0 - (0.01 / a) ** 2)
    return 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "wanted"),  # N at the cycles: 2 p / K
    [
        (saturation, 1.0 / 1.02),
        (saturation, 0.7),
        (saturation, 1.05),
        (relay, 3.0),
        (relay_with_a_dead_zone, 5.0),
        (relay_with_a_dead_zone, 40.0),
        (relay_with_a_dead_zone, 62.0),
    ],
)
def test_the_cycles_of_a_closed_form_are_stable_where_its_gain_falls(law, wanted):
    """The largest N of the relay with a dead zone is 63.7, at 0.0141; N = 62 at 0.0126 and
    0.0162.
    """
    turn = 40.0
    places = np.geomspace(1e-3, 3.0, 200_001)
    loop = Formula(law, 2.0 * turn / wanted, turn)
    signs = np.diff(np.sign([law(a) - wanted for a in places]))
    for cycle, sign in zip(cycles(loop), (-1, 1), strict=True):
        crossings = np.flatnonzero(signs * sign > 0)
        assert [amplitude for amplitude, _ in cycle] == pytest.approx(places[crossings], rel=1e-4)
        assert [omega for _, omega in cycle] == pytest.approx([turn] * len(crossings), rel=1e-6)
    assert switches(loop) == (law is relay)


@smc.law_function(gains={"k": 2.5, "d": 0.01})
def thruster(y, gains, memory):
    """Pushes back outside a dead zone of the position."""
    return -gains.k * math.copysign(1.0, y.x) if abs(y.x) > gains.d else 0.0, y.x


def test_of_the_two_cycles_behind_a_dead_zone_a_run_ends_in_the_outer_one_or_rests():
    damped = smc.plant("duffing", alpha=0.0, beta=0.0, delta=2.0)
    scenario = smc.Scenario(
        plant=damped,
        law=thruster(),
        actuator=smc.Lag(0.02),
        v0=0.0,
        duration=20.0,
    )
    cycle = chattering(scenario)
    # where 4 k |L| sqrt(1 - (d / a)^2) / (pi a) is 1
    assert cycle.threshold_x == pytest.approx(0.0107, rel=0.01)
    assert "x beyond threshold_x" in cycle.assumptions
    calm, *swinging = smc.run(
        [dataclasses.replace(scenario, x0=q * cycle.threshold_x) for q in (0.9, 1.1, 10.0)]
    )
    assert np.ptp(calm.s[calm.t > 10.0]) == 0.0
    for trace in swinging:
        assert channel_cycle(trace) == pytest.approx((cycle.amplitude, cycle.frequency), rel=0.02)
    assert cycle.uncertainty < 0.05  # the law as it is, later and earlier: all of the outer cycle


def test_under_an_integrator_of_first_order_what_half_the_step_leaves_counts_too():
    """A number with an error of h c and so with c (h - h / 2) = c h / 2 between the runs: the error
    itself is told.
    """
    exact = 2.0
    error = 0.3
    halves = [exact + error / 2**k for k in range(2)]
    assert relative_range(halves) == pytest.approx(0.5 * error / (exact + error / 2))
    assert relative_range(halves, first_order=True) == pytest.approx(error / exact)
    # another nudged start
    assert relative_range([*halves, 4.0], first_order=True) == pytest.approx(4.0 / exact - 1.0)
    never = (math.inf, math.inf), (math.nan,) * 2, (0.2,)
    assert [relative_range(values, first_order=True) for values in never] == [0.0, 0.0, 0.0]
    assert relative_range((0.2, math.inf), first_order=True) == math.inf


def test_an_array_in_place_of_a_channel_is_refused(refused):
    refused(lambda: chattering("pid", np.ones(3), plant="duffing"), "give")  # type: ignore[arg-type]
