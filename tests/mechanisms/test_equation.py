"""Each ideal plant is its differential equation, held against scipy's DOPRI5 on the equations of
the study.

Nothing of the plants' own `nominal` is used: the right-hand sides, the laws and the sample-and-hold
with its delay are written again here.
"""

import dataclasses
import functools
import math

import numpy as np
import pytest
from scipy.integrate import ode

import smc_mujoco as smc


def springs(x):
    """Pull of the neighbours in a chain with free ends: x[i-1] - 2 x[i] + x[i+1]."""
    gap = x[..., 1:] - x[..., :-1]
    pull = np.zeros_like(x)
    pull[..., :-1] += gap
    pull[..., 1:] -= gap
    return pull


def pendulum(side, coupled=False):
    def acceleration(p, x, v, force):
        pull = p.kc * springs(x) if coupled else 0.0
        return (side * p.m * p.grav * p.l * np.sin(x) - p.b * v + pull + force) / (p.m * p.l**2)

    return acceleration


# x'' of every plant from its parameters, x and v (..., n), and the force u + d.
EQUATION = {
    "inverted_pendulum": pendulum(+1),
    "inverted_pendulum_network": pendulum(+1, coupled=True),
    "pendulum_network": pendulum(-1, coupled=True),
    "van_der_pol": lambda p, x, v, force: (p.mu * (1 - x**2) * v - p.k * x + force) / p.M,
    "duffing": lambda p, x, v, force: (-p.delta * v - p.alpha * x - p.beta * x**3 + force) / p.M,
}
# The smooth laws, u from e and e'.
SMOOTH = {
    "observer_free": lambda g, e, de: -g["lam"] * np.tanh(de + g["k1"] * e),
    "boundary_layer": lambda g, e, de: -g["k"] * np.clip((de + g["c"] * e) / g["phi"], -1, 1),
}
PLANTS = pytest.mark.parametrize("plant", sorted(EQUATION))
SINE = smc.Sine(amplitude=0.2, omega=5.0)


def integrated(slope, y, t, h):
    """y at t + h, where y' = slope(t, y) and y is an array of any shape."""
    solver = ode(lambda t, flat: slope(t, flat.reshape(y.shape)).ravel())
    solver.set_integrator(
        "dopri5",
        rtol=1e-12,
        atol=1e-14,
        first_step=h,
    )
    end = solver.set_initial_value(y.ravel(), t).integrate(t + h)
    assert solver.successful()
    return end.reshape(y.shape)


def sine(signal, t):
    return signal.amplitude * np.sin(signal.omega * t)


def oracle(scenarios, factor=1.0):
    """x and v (K+1, m, n) of closed loops: smooth laws on the oracle's own state, held, delayed and
    integrated.

    The m scenarios differ in their laws alone, so that one integration is enough. `factor`
    multiplies the true mass.
    """
    s = scenarios[0].resolved
    for scenario in scenarios:
        assert dataclasses.replace(scenario, law=s.law) == scenarios[0]
    equation = EQUATION[s.plant.name]
    h = s.physics_step
    delay = round(s.input_delay / h)
    if s.jump is None:
        jump = math.inf
    else:
        jump = round(s.jump.time / h)
    y = np.array([[s.x0, s.v0]] * len(scenarios)).swapaxes(0, 1)
    commands = []
    states = []
    before = s.plant.values({**s.mismatch, "mass": factor * s.mismatch.get("mass", 1.0)})
    if s.jump:
        after = s.plant.values(s.factors(jump))
    else:
        after = before
    for step in range(s.samples * s.steps + 1):
        if step % s.steps == 0:
            r = sine(s.reference, step * h)
            dr = s.reference.amplitude * s.reference.omega * math.cos(s.reference.omega * step * h)
            u = []
            for o, x, v in zip(scenarios, *y, strict=True):
                u.append(SMOOTH[o.law.name](o.law.gains, x - r, v - dr))
            commands.append(np.clip(u, -s.u_max, s.u_max))
            states.append(y)
        p = after if step >= jump else before
        if step >= delay:
            u = commands[(step - delay) // s.steps]
        else:
            u = 0.0
        slopes = np.empty_like(y)

        def slope(t, y, p=p, u=u, slopes=slopes):
            d = sum(signal.amplitude * math.sin(signal.omega * t) for signal in s.disturbance)
            slopes[0] = y[1]
            slopes[1] = equation(p, y[0], y[1], u + d)
            return slopes

        y = integrated(slope, y, step * h, h)
    return np.array(states).transpose(2, 0, 1, 3)


def error(trace, states):
    """Largest errors of x and of v."""
    return np.abs(states[:, 0] - trace.x).max(), np.abs(states[:, 1] - trace.v).max()


DURATION = {"inverted_pendulum_network": 10.0}  # s; the others: 2 s


@functools.cache
def long(plant):
    """Law -> the scenario of `everything`, and the oracle's states."""
    scenarios = [everything(plant, law) for law in SMOOTH]
    return dict(zip(SMOOTH, zip(scenarios, oracle(scenarios), strict=True), strict=True))


def everything(plant, law):
    """A tracking run with delay, sine disturbance, 30 % more mass than believed, and a jump."""
    return dataclasses.replace(
        smc.paper.scenario(plant, law, "jump_mild", duration=DURATION.get(plant, 2.0)),
        reference=smc.Sine(amplitude=0.1, omega=2.0),
        input_delay=0.007,
        mismatch={"mass": 1.3},
    )


@pytest.mark.quick
def test_every_plant_of_the_study_has_its_equation_here():
    # the others: test_underactuated.py and test_rig_plants.py
    assert set(smc.paper.GAINS) == set(EQUATION)


@pytest.mark.slow
@PLANTS
@pytest.mark.parametrize("law", sorted(SMOOTH))
def test_seconds_of_the_closed_loop_follow_the_equation(plant, law):
    scenario, states = long(plant)[law]
    assert scenario.jump is not None
    assert scenario.jump.time == scenario.duration / 2
    assert scenario.resolved.physics_step == 1e-3
    assert scenario.resolved.integrator == "RK4"
    x, v = error(smc.run(scenario), states)
    assert x < 1e-10  # the requirement is 1e-7
    assert v < 1e-9


@PLANTS
def test_a_delay_that_is_no_multiple_of_the_control_period_is_exact(plant):
    scenario = dataclasses.replace(
        everything(plant, "observer_free"),
        control_period=5e-3,
        physics_step=1e-3,
        duration=0.5,
        jump=None,
    )
    x, v = error(smc.run(scenario), *oracle([scenario]))
    assert x < 1e-10
    assert v < 1e-9


@PLANTS
def test_a_mass_off_by_a_millionth_is_noticed(plant):
    scenario = dataclasses.replace(
        everything(plant, "observer_free"),
        duration=0.5,
        jump=None,
    )
    assert error(smc.run(scenario), *oracle([scenario], factor=1 + 1e-6))[0] > 1e-8


@functools.cache
def coarse(plant):
    """A scenario of few control periods, and the oracle's states."""
    scenario = dataclasses.replace(
        smc.paper.scenario(plant, "observer_free", "sine"),
        reference=smc.Sine(amplitude=0.1, omega=2.0),
        duration=2.0,
        control_period=8e-3,
        physics_step=8e-3,
    )
    return scenario, *oracle([scenario])


@pytest.mark.parametrize(
    ("plant", "integrator", "order"),
    [
        *((plant, "RK4", 4) for plant in sorted(EQUATION)),
        ("duffing", "Euler", 1),
        ("inverted_pendulum", "implicitfast", 1),
        ("inverted_pendulum_network", "implicit", 1),
        ("pendulum_network", "Euler", 1),
        ("van_der_pol", "implicitfast", 1),
    ],
)
def test_the_error_falls_with_the_order_of_the_integrator(plant, integrator, order):
    (scenario, states), steps = coarse(plant), (8e-3, 4e-3, 2e-3)
    traces = smc.run(
        [
            dataclasses.replace(
                scenario,
                physics_step=h,
                integrator=integrator,
            )
            for h in steps
        ]
    )
    errors = [error(trace, states)[0] for trace in traces]
    slopes = np.diff(np.log(errors)) / np.diff(np.log(steps))
    assert np.all(np.abs(slopes - order) < (0.3 if order == 4 else 0.1)), slopes


STUDIED = [*smc.paper.GAINS["duffing"], "none"]  # laws
HALF = 0.25  # s
CONDITIONS = {
    "nominal": {},
    "noise": {"noise": smc.Noise(position=0.01, velocity=0.05)},
    "sines": {"disturbance": (SINE, smc.Sine(amplitude=1.0, omega=30.0))},
    "step": {"disturbance": smc.Step(0.2, time=HALF)},
    "pulse": {"disturbance": smc.signals.Pulse(2.0, time=HALF, width=0.1)},
    "process_noise": {"disturbance": smc.signals.OrnsteinUhlenbeck(sigma=0.2, tau=0.1)},
    "delay": {"input_delay": 0.02},
    "light": {"mismatch": {"mass": 0.7}},
    "differenced": {"velocity": "filtered_difference"},
    "jump": {},
}


def disturbance(trace, since):
    """d at each t_k + since, (K, n).

    What is neither a sine nor process noise is constant within a step here.
    """
    step = trace.scenario.resolved.physics_step
    rise = np.diff(trace.d, axis=0) * since / step  # knots at the steps, linear between them
    d = np.zeros_like(rise)
    for signal in trace.scenario.disturbance:
        if isinstance(signal, smc.Sine):
            d += sine(signal, trace.t[:-1, None] + since)
        elif isinstance(signal, smc.signals.OrnsteinUhlenbeck):
            d += trace.d[:-1] + rise
        else:
            d += trace.d[:-1]
    return d


@pytest.mark.parametrize(
    ("plant", "condition"),
    [
        (p, c)
        for i, p in enumerate(sorted(EQUATION))
        for j, c in enumerate(CONDITIONS)
        if (i + j) % 5 in (0, 2)
    ],
)
def test_every_step_of_every_law_obeys_the_equation(plant, condition):
    """From each logged state, one step with the logged control ends in the next logged state."""
    fields = CONDITIONS[condition]
    if condition == "jump":
        fields = {
            "jump": smc.Jump(
                time=HALF,
                factors=smc.plant(plant).jumps["mild"],
            ),
            "disturbance": SINE,
        }
    scenarios = []
    for law in STUDIED:
        scenarios.append(
            dataclasses.replace(smc.paper.scenario(plant, law), duration=2 * HALF, **fields)
        )
    for trace in smc.run(scenarios):
        s = trace.scenario
        states = np.stack([trace.x, trace.v])
        for first, last in (
            (0, s.samples // 2),
            (s.samples // 2, s.samples),
        ):
            p = s.plant.values(s.factors(first))
            part = slice(first, last)

            def slope(since, y, p=p, part=part, trace=trace):
                force = trace.applied[part] + disturbance(trace, since)[part]
                return np.stack([y[1], EQUATION[plant](p, y[0], y[1], force)])

            end = integrated(slope, states[:, part], 0.0, s.resolved.physics_step)
            np.testing.assert_allclose(
                end, states[:, first + 1 : last + 1], rtol=0, atol=1e-10, err_msg=str(s.law)
            )


def test_a_cart_that_becomes_heavier_on_its_way_accelerates_less():
    cart = smc.plant(
        "servo_axis",
        M=2.0,
        b=0.0,
        cf=0.0,
        offset=0.0,
    )
    parts = {
        "disturbance": smc.Constant(1.0),
        "jump": smc.Jump(0.1, {"mass": 4.0}),
        "duration": 0.3,
    }
    trace = smc.run(
        smc.Scenario(
            plant=cart,
            law="none",
            x0=0.0,
            **parts,
        )
    )
    after = np.maximum(trace.t - 0.1, 0.0)
    np.testing.assert_allclose(
        trace.v[:, 0], np.minimum(trace.t, 0.1) / 2.0 + after / 8.0, atol=1e-12
    )
