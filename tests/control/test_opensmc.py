"""Our laws against opensmc 2.0.0's own functions where those are right.

opensmc counts its error the other way round, e = r - x, and its default plant is x'' = u + d: at r
= 0 its controllers' u is ours with the nominal model f = 0, g = 1; its reaching laws give our
model-free u. Left out where opensmc is not installed (make bench installs it).
"""

import math

import numpy as np
import pytest
from helpers.plants_ab import called, measured

import smc_mujoco as smc
from smc_mujoco.control.estimator import Reading, estimator
from smc_mujoco.control.surface import surface
from smc_mujoco.simulation import python_functions

opensmc = pytest.importorskip("opensmc")
controllers, reaching, surfaces, estimators, metrics, utils, simulator, core, plants = (
    pytest.importorskip(f"opensmc.{name}")
    for name in (
        "controllers",
        "reaching",
        "surfaces",
        "estimators",
        "metrics",
        "utils",
        "simulator",
        "core",
        "plants",
    )
)

H = 1e-3
STATES = np.random.default_rng(0).normal(scale=(1.0, 2.0), size=(400, 2))


def own(component, **given):
    """A law or a surface of this package with its memory, as a function."""
    memory = np.zeros(component.memory)
    return lambda e=0.0, de=0.0, **more: called(
        component, measured(e, de, **(given | more)), memory
    )


def along(ours, theirs, states=STATES, rtol=1e-12):
    """Fail unless two functions of (e, de) agree at one state after the other, memories and all."""
    for e, de in states.tolist():
        assert ours(e, de) == pytest.approx(theirs(e, de), rel=rtol, abs=1e-12)


def controlled(controller, **more):
    """u of a controller of theirs at r = 0."""
    return lambda e, de: float(controller.compute(0.0, np.array([e, de]), np.zeros(2), **more)[0])


def test_their_controller_is_a_law_in_one_line():
    theirs = smc.law_from(
        controllers.LQR(A=[[0.0, 1.0], [0.0, 0.0]], B=[[0.0], [1.0]], Q=np.diag([9.0, 1.0]))
    )
    ours = smc.law("lqr", q1=9.0, q2=1.0, r=1.0, a1=0.0, a2=0.0, b=1.0)
    plain = {"plant": "duffing", "reference": smc.Sine(0.3, 2.0), "duration": 1.0}
    runs = smc.run([smc.Scenario(law=law, **plain) for law in (theirs, ours)])
    np.testing.assert_allclose(runs[0].u, runs[1].u, rtol=1e-6, atol=1e-8)


# reaching laws: ours without the model, on s


@pytest.mark.parametrize(
    ("law", "theirs"),
    [
        (smc.law("classical", k=2.0), lambda: reaching.ConstantRate(k=2.0)),
        (
            smc.law("exponential_reaching", k=2.0, q=3.0),
            lambda: reaching.ExponentialRate(k=2.0, q=3.0),
        ),
        (smc.law("power_rate", k=2.0, a=0.7), lambda: reaching.PowerRate(k=2.0, alpha=0.7)),
        (smc.law("boundary_layer", k=2.0, phi=0.4), lambda: reaching.Saturation(k=2.0, phi=0.4)),
        (
            smc.law("super_twisting", k1=2.0, k2=3.0),
            lambda: reaching.SuperTwisting(k1=2.0, k2=3.0, dt=H),
        ),
    ],
    ids=lambda v: getattr(v, "name", ""),
)
def test_reaching_laws_agree(law, theirs):
    ours = own(law)
    other = theirs()
    along(lambda e, de: ours(0.0, de)[0], lambda e, de: other.compute(de))


# controllers: ours with the model, on e and de


@pytest.mark.parametrize(
    ("law", "theirs"),
    [
        (
            smc.law("exponential_reaching", k=1.1, q=4.0, c=3.0),
            lambda: controllers.ClassicalSMC(c=3.0, k=4.0, eta=1.1),
        ),
        (
            smc.law("fixed_time", k1=2.0, k2=3.0, a=0.6, b=1.4, k=0.0, c=3.0),
            lambda: controllers.FixedTimeSMC(c=3.0, alpha=2.0, beta=3.0, p=0.6, q=1.4),
        ),
        (
            smc.law("discrete_reaching", eps=2.0, q=3.0, c=2.5),
            lambda: controllers.DiscreteSMC(c=2.5, q_rate=3.0, epsilon=2.0, Ts=H, u_max=1e9),
        ),
        (
            smc.law("lqr", q1=10.0, q2=2.0, r=0.5),
            lambda: controllers.LQR(
                [[0, 1], [0, 0]], [[0], [1]], Q=np.diag([10.0, 2.0]), R=[[0.5]]
            ),
        ),
        (smc.law("pid", kp=5.0, ki=0.0, kd=2.0, tau=0.0), lambda: controllers.PID(Kp=5.0, Kd=2.0)),
        (smc.law("computed_torque", kp=5.0, kd=2.0), lambda: controllers.PID(Kp=5.0, Kd=2.0)),
    ],
    ids=lambda v: getattr(v, "name", ""),
)
def test_controllers_agree(law, theirs):
    ours = own(law, model=1.0)
    other = controlled(theirs())
    along(lambda e, de: ours(e, de)[0], other, rtol=1e-9)


def test_the_integral_of_a_pid_agrees_but_for_one_sample():
    """Theirs counts the sample's own error before it acts, ours after."""
    ours = own(smc.law("pid", kp=5.0, ki=3.0, kd=2.0, tau=0.0))
    theirs = controlled(controllers.PID(5.0, 2.0, 3.0, H))
    along(lambda e, de: ours(e, de)[0] - 3.0 * H * e, theirs)


def test_the_adaptive_gain_agrees_but_for_one_sample():
    """Theirs grows before it acts, ours after."""
    theirs = controllers.AdaptiveSMC(c=2.0, gamma=5.0, eta0=0.5, eta_max=1e9, lam=0.0, dt=H)
    law = smc.law("adaptive", gamma=5.0, c=2.0, k0=0.5)
    ours = own(law, model=1.0)
    gain = own(law, model=1.0)
    gain(*STATES[0])
    for (e, de), after in zip(STATES.tolist(), STATES[1:].tolist(), strict=False):
        u, s = ours(e, de)
        gain(*after)
        ahead = u - 5.0 * H * abs(s) * math.copysign(1.0, s)
        assert ahead == pytest.approx(controlled(theirs)(e, de), rel=1e-9)


@pytest.mark.parametrize(
    ("law", "theirs"),
    [
        (smc.law("quasi_continuous", a=6.0, b=1.0), ("QuasiContinuousHOSMC", 6.0, [1.0])),
        (smc.law("prescribed_convergence", a=5.0, b=2.0), ("NestedHOSMC", 5.0, [2.0])),
    ],
    ids=lambda v: getattr(v, "name", ""),
)
def test_second_order_laws_agree_when_theirs_are_told_sigma_and_its_rate(law, theirs):
    name, alpha, betas = theirs
    ours = own(law)
    other = getattr(controllers, name)(order=2, alpha=alpha, betas=betas, g_sign=1.0)
    along(
        lambda e, de: ours(e, de)[0],
        lambda e, de: other.compute(0.0, None, None, sigma_derivs=[e, de])[0],
        rtol=1e-6,  # theirs adds 1e-10 to denominators
    )


class Itself(core.SlidingSurface):
    """sigma = e, of relative degree 2."""

    def compute(self, e, edot, t=0.0, **kwargs):
        return e


def test_twisting_agrees_when_theirs_is_handed_a_variable_of_relative_degree_2():
    ours = own(smc.law("twisting", r1=3.0, r2=2.0))
    theirs = controllers.TwistingSMC(3.0, 2.0, surface=Itself())
    along(lambda e, de: ours(e, de)[0], controlled(theirs))


# surfaces and estimators


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (surface("linear", c=3.0), lambda: surfaces.LinearSurface(c=3.0)),
        (surface("terminal", b=2.0, p=5 / 7), lambda: surfaces.TerminalSurface(beta=2.0, p=5, q=7)),
        (
            surface("nonsingular_terminal", B=2.0, p=7 / 5),
            lambda: surfaces.NonsingularTerminalSurface(2.0, 5, 7),
        ),
    ],
    ids=lambda v: getattr(v, "name", ""),
)
def test_surfaces_agree(ours, theirs):
    mine = own(ours)
    other = theirs()
    along(lambda e, de: mine(e, de)[0], lambda e, de: float(other.compute(e, de)))


def test_the_global_surface_agrees():
    ours = own(surface("global_", c=3.0, q=2.0))
    theirs = surfaces.GlobalSurface(c=3.0, alpha=2.0)
    for k, (e, de) in enumerate(STATES.tolist()):
        assert ours(e, de, t=k * H)[0] == pytest.approx(
            float(theirs.compute(e, de, t=k * H)), abs=1e-12
        )


def test_the_integral_of_a_pid_surface_agrees_but_for_one_sample():
    ours = own(surface("pid", kp=3.0, ki=2.0))
    theirs = surfaces.PIDSurface(alpha=1.0, beta=3.0, gamma=2.0, dt=H)
    along(lambda e, de: ours(e, de)[0] + 2.0 * H * e, theirs.compute)


def estimated(ours, theirs, h, until):
    """Both estimates of the velocity of sin t: ours, theirs, (K,) each, from t = 0 on."""
    t = np.arange(0.0, until, h)
    gains = python_functions.gains_of(ours)
    memory = np.zeros(ours.memory)
    rows = []
    for x in np.sin(t):
        out = ours.function(Reading(h, float(x), 0.0), gains, memory)
        theirs.estimate(0.0, [float(x)], 0.0)
        rows.append((out[0] if isinstance(out, tuple) else out, theirs._z[1]))
    return np.array(rows).T


def test_levant_s_first_order_differentiator_agrees():
    """Theirs starts at 0, as sin t does, and gives the state after the sample's step: ours one
    sample later.
    """
    theirs = estimators.LevantDifferentiator(order=1, L=4.0, dt=H)
    ours, other = estimated(estimator("levant", L=4.0, order=1), theirs, H, 3.0)
    np.testing.assert_allclose(ours[1:], other[:-1], atol=1e-12)


@pytest.mark.parametrize(
    ("name", "make"),
    [
        (
            "high_gain",
            lambda h: estimators.HighGainObserver(alpha1=1.0, alpha2=2.0, epsilon=0.05, dt=h),
        ),
        (
            "extended_state_observer",
            lambda h: estimators.ExtendedStateObserver(3.0, 3.0, 1.0, 0.05, dt=h),
        ),
        (
            "integral_chain",
            lambda h: estimators.IntegralChainDifferentiator(order=2, epsilon=0.05, dt=h),
        ),
    ],
)
def test_linear_observers_agree_to_the_order_of_the_period(name, make):
    """Theirs are explicit Euler steps of the same equations, w = 1 / epsilon; ours are exact or as
    good.
    """
    apart = []
    for h in (2e-3, 2e-4):
        ours, other = estimated(estimator(name, w=20.0), make(h), h, 3.0)
        apart.append(np.abs(ours - other)[len(ours) // 2 :].max())
    assert apart[1] < 3e-3
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.2)
