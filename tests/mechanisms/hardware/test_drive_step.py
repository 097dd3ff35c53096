"""Lags, rate limits and drives in series do what their equations say, compiled and in the reference
loop.
"""

import dataclasses
import math

import numpy as np
import pytest
from helpers.reference import advance
from helpers.runs import free_mass
from scipy.integrate import solve_ivp

import smc_mujoco as smc
from smc_mujoco.mechanisms.hardware.drives import drive_step

H = 5e-4  # s
INSTANT = 1e-9  # s, a lag that is none
MOTOR = smc.DCMotor(inductance=5e-3)  # L/R = 16.7 ms


@smc.law_function(gains={"u": 1.0, "omega": 0.0})
def asking(y, gains, memory):
    """u, or u cos(omega t)."""
    return gains.u * math.cos(gains.omega * y.t), y.e


def scenario(*actuator, **fields):
    """A block of 1 kg, here under a constant command."""
    return smc.Scenario(
        **{
            "plant": "duffing",
            "law": asking(),
            "duration": 0.1,
            "physics_step": H,
            "control_period": H,
        }
        | {"actuator": actuator}
        | fields
    )


def mean_risen(t, first, second):
    """The mean output of two lags, from rest under 1, from each time to the next."""
    if first == second:
        integral = t - 2.0 * first + (t + 2.0 * first) * np.exp(-t / first)
    else:
        integral = t + (first**2 * np.expm1(-t / first) - second**2 * np.expm1(-t / second)) / (
            first - second
        )
    return np.diff(integral) / np.diff(t)


@pytest.mark.quick
@pytest.mark.parametrize("step", [1e-3, 2.5e-4])
@pytest.mark.parametrize(
    ("first", "second"),
    [
        (0.02, 0.005),
        (0.005, 0.02),
        (0.01, 0.01),
        (1e-5, 0.01),
        (0.01, 1e-5),
    ],
)
def test_the_mean_force_of_two_lags_is_exact(first, second, step):
    """For a held u there is no error of the step: what is left is rounding, of the closed form,
    too.
    """
    trace = smc.run(
        scenario(
            smc.Lag(first),
            smc.Lag(second),
            physics_step=step,
            control_period=step,
        )
    )
    np.testing.assert_allclose(
        trace.force[1:, 0], mean_risen(trace.t, first, second), rtol=0.0, atol=1e-10
    )
    np.testing.assert_array_equal(trace.applied, 1.0)


@pytest.mark.parametrize("tau", [1e-4, 1e-3, 0.01, 0.5])
def test_a_lag_gives_a_free_mass_its_exact_velocity(tau):
    free = free_mass()
    trace = smc.run(
        scenario(
            smc.Lag(tau),
            plant=free,
            x0=0.0,
            integrator="RK4",
        )
    )
    expected = trace.t + tau * np.expm1(-trace.t / tau)
    np.testing.assert_allclose(
        trace.v[:, 0],
        expected,
        rtol=0.0,
        atol=1e-13,
    )


@smc.law_function(gains={"late": 0.3})
def stepping(y, gains, memory):
    """1, and from `late` seconds on -1."""
    return (1.0 if y.t < gains.late - 1e-9 else -1.0), y.e


def test_a_limited_rate_is_exactly_the_rate_starts_at_zero_and_stops_within_a_step():
    """The mean over steps of a ramp of 12/s, which meets u between two samples."""
    trace = smc.run(
        scenario(
            smc.hardware.RateLimit(12.0),
            law=stepping(late=0.3),
            duration=0.6,
        )
    )
    fine = np.linspace(0.0, 0.6, 600 * 200 + 1)
    force = np.where(
        fine < 0.3, np.minimum(12.0 * fine, 1.0), np.maximum(1.0 - 12.0 * (fine - 0.3), -1.0)
    )
    total = np.concatenate(([0.0], np.cumsum(0.5 * (force[1:] + force[:-1])) * (fine[1] - fine[0])))
    means = np.diff(np.interp(trace.t, fine, total)) / H
    np.testing.assert_allclose(
        trace.force[1:, 0],
        means,
        rtol=0.0,
        atol=1e-5,
    )


@pytest.mark.parametrize("inductance", [1e-4, 5e-3])
def test_a_motors_mean_torque_is_exact_for_a_held_voltage(inductance):
    motor = smc.DCMotor(inductance=inductance)
    trace = smc.run(
        scenario(
            motor,
            law=stepping(late=0.05),
            mismatch={"mass": 1e9},
            x0=0.0,
        )
    )
    late = np.count_nonzero(trace.t[1:] > 0.05 + H / 2)
    up = mean_risen(trace.t, motor.delay, INSTANT)
    down = np.concatenate((np.zeros(len(up) - late), up[:late]))
    assert trace.force[1:, 0] == pytest.approx(up - 2.0 * down, abs=1e-5)


def test_a_rate_limit_follows_the_lag():
    trace = smc.run(scenario(smc.Lag(0.01), smc.hardware.RateLimit(20.0)))
    fine = np.linspace(0.0, 0.1, 100_001)
    lagged = 1.0 - np.exp(-fine / 0.01)
    # the lag is steeper at first, and flatter in the end
    meets = np.argmax((lagged <= 20.0 * fine) & (fine > 0.0))
    force = np.concatenate((20.0 * fine[:meets], lagged[meets:]))
    total = np.concatenate(([0.0], np.cumsum(0.5 * (force[1:] + force[:-1])) * 1e-6))
    assert trace.force[1:, 0] == pytest.approx(
        np.diff(np.interp(trace.t, fine, total)) / H, abs=2e-3
    )


@pytest.mark.parametrize(
    ("tau", "rate"),
    [
        (1e-4, 1e3),
        (1e-3, 100.0),
        (1e-3, 2e3),
        (0.01, 20.0),
    ],
)
def test_a_rate_limit_behind_a_lag_errs_by_less_than_the_lag_moves_in_a_step(tau, rate):
    """It is exact where the force is limited, or follows the lag, all the step."""
    step = 1e-3
    parts = 2000
    u, first, gap = np.random.default_rng(0).normal(size=(3, 500))
    second = first + gap * np.repeat([0.0, 0.01, 0.1, 1.0, 3.0], 100)
    effect = drive_step((smc.Lag(tau), smc.hardware.RateLimit(rate)), step, True)
    assert effect is not None
    mean, last, _ = advance(effect, u, first, second, np.zeros(500))
    lagged = first
    force = second
    total = 0.0
    above = 0
    below = 0
    for t in step * np.arange(1, parts + 1) / parts:
        lagged = u + (first - u) * np.exp(-t / tau)
        before = force
        force = np.clip(lagged, before - rate * step / parts, before + rate * step / parts)
        total = total + 0.5 * (before + force) / parts
        above = above + (lagged > force)
        below = below + (lagged < force)
    error = np.abs(mean - total)
    one_sided = (above + below == 0) | (above == parts) | (below == parts)
    np.testing.assert_allclose(last, lagged, rtol=1e-12)
    assert 100 < one_sided.sum() < 500
    assert error[one_sided].max() < 1e-3
    assert (error <= np.abs(last - first) + 1e-3).all()


def moved(s, u):
    """x of the scenario's Duffing block behind its Lag, if any, and its DCMotor, by SciPy, under
    its samples' u.
    """
    *lags, motor = s.actuator
    inertia = 1.0 + motor.gear**2 * motor.rotor_inertia
    p = s.plant.values({})

    def rates(t, z, u):
        x, v, a, i = z
        f, _ = s.plant.nominal(np.array([x]), np.array([v]), 0, p)  # of 1 kg
        volts = min(max(motor.scale * (a if lags else u), -motor.voltage), motor.voltage)
        lagged = (u - a) / lags[0].tau if lags else 0.0
        across = volts - motor.constant * v
        if motor.inductance:
            current = (across - motor.resistance * i) / motor.inductance
            return v, (f + motor.constant * i) / inertia, lagged, current
        i = across / motor.resistance
        for brush, bridge in ((motor.brush, motor.bridge), (motor.brush_2, motor.bridge_2)):
            turned = math.cos(motor.bars * (motor.gear * x - brush)) - 1.0
            i += (
                motor.ripple
                * math.exp(turned / (motor.bars * bridge) ** 2)
                * across
                / motor.resistance
            )
        return v, (f + motor.constant * i) / inertia, lagged, 0.0

    z = [s.resolved.x0[0], s.resolved.v0[0], 0.0, 0.0]
    x = [z[0]]
    for held in u[:-1, 0]:
        z = solve_ivp(
            rates, (0.0, s.control_period), z, "LSODA", args=(held,), rtol=1e-10, atol=1e-13
        ).y[:, -1]
        x.append(z[0])
    return np.array(x)


# L/R = 0.8 ms; 1.3 N m s/rad of back-EMF
WEAK = smc.DCMotor(0.5, 4e-4, 0.4, 2.0, 1e-4, voltage=3.0, command="voltage")


@pytest.mark.parametrize(
    "actuator",
    [
        (smc.Lag(0.02), MOTOR),
        (MOTOR,),
        (WEAK,),
    ],
    ids=["lag", "alone", "weak"],
)
@pytest.mark.parametrize("integrator", ["RK4", "implicitfast"])
def test_a_motor_moves_the_block_as_scipy_says(actuator, integrator):
    """To second order in the step; under implicitfast to first, because it moves the block by its
    speed at the end.
    """
    law = asking(u=4.0, omega=5.0)
    base = scenario(
        *actuator,
        law=law,
        x0=0.3,
        v0=1.0,
        duration=0.3,
        control_period=2e-3,
        integrator=integrator,
        u_max=4.0,
    )
    traces = smc.run([dataclasses.replace(base, physics_step=step) for step in (1e-3, 2.5e-4)])
    exact = moved(base, traces[0].u)
    errors = []
    for trace in traces:
        errors.append(np.abs(trace.x[:, 0] - exact).max())
    assert np.ptp(exact) > 0.05
    if integrator == "RK4":
        assert errors[0] < 1e-5
        assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.1)
    else:
        assert errors[1] < 2.5e-4 * np.abs(traces[1].v).max()
        assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize("before", [(smc.Lag(0.02),), ()])
@pytest.mark.parametrize("after", [(smc.Backlash(0.0, rotor_inertia=1e-9),), ()])
def test_a_commutator_ripples_behind_a_lag_and_before_a_play(before, after):
    motor = smc.DCMotor(0.5, 0.0, 0.4, 2.0, 1e-4, voltage=9.0, ripple=0.5, bridge=0.1, bridge_2=0.1)
    common = {"law": asking(u=4.0, omega=5.0), "x0": 0.3, "v0": 1.0, "duration": 0.3, "u_max": 4.0}
    even = dataclasses.replace(motor, ripple=0.0)
    ours, plain = smc.run(
        [scenario(*before, part, *after, physics_step=1.25e-4, **common) for part in (motor, even)]
    )
    exact = moved(scenario(*before, motor, **common), ours.u)
    assert np.abs(ours.x[:, 0] - exact).max() < 1e-4
    assert np.abs(plain.x[:, 0] - exact).max() > 1e-3


def test_a_free_rotor_is_the_second_order_system_of_its_equations_with_any_step():
    """Under a held voltage it has the exact speed and current but for the bend of the speed within
    a step.
    """
    motor = smc.DCMotor(inductance=20e-3)
    free = free_mass()
    trace = smc.run(
        scenario(
            motor,
            plant=free,
            law=asking(u=6.0 / motor.scale),
            x0=0.0,
            u_max=99.0,
            duration=3.0,
        )
    )
    inertia = 1.0 + motor.gear**2 * motor.rotor_inertia
    system = np.array(
        [
            [-motor.resistance / motor.inductance, -motor.constant / motor.inductance],
            [motor.constant / inertia, 0.0],
        ]
    )
    rates, modes = np.linalg.eig(system)
    rest = np.array([0.0, 6.0 / motor.constant])
    exact = (
        rest[:, None]
        + ((modes * np.linalg.solve(modes, -rest)) @ np.exp(np.outer(rates, trace.t))).real
    )
    np.testing.assert_allclose(trace.v[:, 0], exact[1], atol=1e-7 * exact[1].max())
    means = 0.5 * motor.constant * (exact[0][1:] + exact[0][:-1])
    np.testing.assert_allclose(trace.force[1:, 0], means, atol=1e-3 * means.max())


@pytest.mark.parametrize("inductance", [0.0, 8e-5])
def test_the_supply_and_the_amplifier_limit_the_torque(inductance):
    by_current = smc.DCMotor(inductance=inductance)
    cases = [
        (by_current, 30.0 * by_current.constant),
        (smc.DCMotor(inductance=inductance, voltage=6.0), 6.0 / by_current.scale),
        (
            smc.DCMotor(
                inductance=inductance,
                voltage=math.inf,
                current=math.inf,
            ),
            100.0,
        ),
    ]
    for motor, most in cases:
        held = scenario(
            motor,
            law=asking(u=100.0),
            u_max=math.inf,
            mismatch={"mass": 1e9},
            x0=0.0,
            duration=0.05,
        )
        torque = smc.run(held).force[:, 0]
        assert torque.max() == pytest.approx(most, rel=1e-6)
        assert torque[-1] == pytest.approx(most, rel=1e-6)


def test_u_is_bounded_and_delayed_before_the_drives():
    late = smc.run(
        scenario(
            smc.Lag(0.01),
            smc.DCMotor(),
            law=asking(u=3.0),
            u_max=2.0,
            input_delay=4 * H,
        )
    )
    assert (late.u == 2.0).all()
    assert late.applied[:, 0].tolist() == [0.0] * 4 + [2.0] * (len(late.t) - 4)
    lags = smc.run(
        scenario(
            smc.Lag(0.01),
            smc.Lag(0.02),
            law=asking(u=3.0),
            u_max=2.0,
            input_delay=4 * H,
        )
    )
    assert (lags.force[:5] == 0.0).all()
    assert lags.force[5:, 0] == pytest.approx(2.0 * mean_risen(lags.t[:-4], 0.01, 0.02), abs=1e-10)
