"""Our laws against opensmc 2.0.0's own functions where those are right; and where they are not, what is wrong.

opensmc counts its error the other way round, e = r - x, and its default plant is x'' = u + d: at r = 0 its controllers'
u is ours with the nominal model f = 0, g = 1; its reaching laws give our model-free u. Left out where opensmc is not
installed (make bench installs it).
"""

import math
import warnings

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.control.estimator import Reading, estimator
from smc_mujoco.control.law import Measurement
from smc_mujoco.control.surface import surface
from smc_mujoco.simulation import python_controller

opensmc = pytest.importorskip("opensmc")
controllers, reaching, surfaces, estimators, metrics, utils, simulator, core, plants = (
    pytest.importorskip(f"opensmc.{name}")
    for name in (
        "controllers", "reaching", "surfaces", "estimators", "metrics", "utils", "simulator", "core", "plants",
    )
)  # fmt: skip

H = 1e-3
STATES = np.random.default_rng(0).normal(scale=(1.0, 2.0), size=(400, 2))


def measured(e=0.0, de=0.0, dt=H, **more):
    """What a law of this package measures with the reference at 0."""
    zero = {"r": 0.0, "dr": 0.0, "ddr": 0.0}
    return Measurement(**({"t": 0.0, "dt": dt, "x": e, "v": de, "e": e, "de": de, "f": 0.0, "g": 1.0} | zero | more))


class Ours:
    """A law, a surface or an estimator of this package with its memory, called like a function."""

    def __init__(self, component, **more):
        self.function, self.gains, self.more = component.function, python_controller.gains_of(component), more
        self.memory = np.zeros(component.memory)

    def __call__(self, e=0.0, de=0.0, **more):
        return self.function(measured(e, de, **(self.more | more)), self.gains, self.memory)


def along(ours, theirs, states=STATES, rtol=1e-12):
    """Fail unless two functions of (e, de) agree at one state after the other, memories and all."""
    for e, de in states.tolist():
        assert ours(e, de) == pytest.approx(theirs(e, de), rel=rtol, abs=1e-12)


def controlled(controller, **more):
    """u of a controller of theirs at r = 0."""
    return lambda e, de: float(controller.compute(0.0, np.array([e, de]), np.zeros(2), **more)[0])


# reaching laws: ours without the model, on s


@pytest.mark.parametrize(
    ("law", "theirs"),
    [
        (smc.law("classical", k=2.0), lambda: reaching.ConstantRate(k=2.0)),
        (smc.law("exponential_reaching", k=2.0, q=3.0), lambda: reaching.ExponentialRate(k=2.0, q=3.0)),
        (smc.law("power_rate", k=2.0, a=0.7), lambda: reaching.PowerRate(k=2.0, alpha=0.7)),
        (smc.law("boundary_layer", k=2.0, phi=0.4), lambda: reaching.Saturation(k=2.0, phi=0.4)),
        (smc.law("super_twisting", k1=2.0, k2=3.0), lambda: reaching.SuperTwisting(k1=2.0, k2=3.0, dt=H)),
    ],
    ids=lambda v: getattr(v, "name", ""),
)
def test_reaching_laws_agree(law, theirs):
    ours, other = Ours(law), theirs()
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
            lambda: controllers.LQR([[0, 1], [0, 0]], [[0], [1]], Q=np.diag([10.0, 2.0]), R=[[0.5]]),
        ),
        (smc.law("pid", kp=5.0, ki=0.0, kd=2.0, tau=0.0), lambda: controllers.PID(Kp=5.0, Kd=2.0)),
        (smc.law("computed_torque", kp=5.0, kd=2.0), lambda: controllers.PID(Kp=5.0, Kd=2.0)),
    ],
    ids=lambda v: getattr(v, "name", ""),
)
def test_controllers_agree(law, theirs):
    ours, other = Ours(law, model=1.0), controlled(theirs())
    along(lambda e, de: ours(e, de)[0], other, rtol=1e-9)


def test_the_integral_of_a_pid_agrees_but_for_one_sample():
    """Theirs counts the sample's own error before it acts, ours after."""
    ours, theirs = Ours(smc.law("pid", kp=5.0, ki=3.0, kd=2.0, tau=0.0)), controlled(controllers.PID(5.0, 2.0, 3.0, H))
    along(lambda e, de: ours(e, de)[0] - 3.0 * H * e, theirs)


def test_the_adaptive_gain_agrees_but_for_one_sample():
    """Theirs grows before it acts, ours after."""
    theirs = controllers.AdaptiveSMC(c=2.0, gamma=5.0, eta0=0.5, eta_max=1e9, lam=0.0, dt=H)
    law = smc.law("adaptive", gamma=5.0, c=2.0, k0=0.5)
    ours, gain = Ours(law, model=1.0), Ours(law, model=1.0)
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
    ours, other = Ours(law), getattr(controllers, name)(order=2, alpha=alpha, betas=betas, g_sign=1.0)
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
    ours, theirs = Ours(smc.law("twisting", r1=3.0, r2=2.0)), controllers.TwistingSMC(3.0, 2.0, surface=Itself())
    along(lambda e, de: ours(e, de)[0], controlled(theirs))


# surfaces and estimators


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (surface("linear", c=3.0), lambda: surfaces.LinearSurface(c=3.0)),
        (surface("terminal", b=2.0, p=5 / 7), lambda: surfaces.TerminalSurface(beta=2.0, p=5, q=7)),
        (surface("nonsingular_terminal", B=2.0, p=7 / 5), lambda: surfaces.NonsingularTerminalSurface(2.0, 5, 7)),
    ],
    ids=lambda v: getattr(v, "name", ""),
)
def test_surfaces_agree(ours, theirs):
    mine, other = Ours(ours), theirs()
    along(lambda e, de: mine(e, de)[0], lambda e, de: float(other.compute(e, de)))


def test_the_global_surface_agrees():
    ours, theirs = Ours(surface("global_", c=3.0, q=2.0)), surfaces.GlobalSurface(c=3.0, alpha=2.0)
    for k, (e, de) in enumerate(STATES.tolist()):
        assert ours(e, de, t=k * H)[0] == pytest.approx(float(theirs.compute(e, de, t=k * H)), abs=1e-12)


def test_the_integral_of_a_pid_surface_agrees_but_for_one_sample():
    ours, theirs = Ours(surface("pid", kp=3.0, ki=2.0)), surfaces.PIDSurface(alpha=1.0, beta=3.0, gamma=2.0, dt=H)
    along(lambda e, de: ours(e, de)[0] + 2.0 * H * e, theirs.compute)


def estimated(ours, theirs, h, until):
    """Both estimates of the velocity of sin t: ours, theirs, (K,) each, from t = 0 on."""
    t = np.arange(0.0, until, h)
    gains, memory, rows = python_controller.gains_of(ours), np.zeros(ours.memory), []
    for x in np.sin(t):
        out = ours.function(Reading(h, float(x), 0.0), gains, memory)
        theirs.estimate(0.0, [float(x)], 0.0)
        rows.append((out[0] if isinstance(out, tuple) else out, theirs._z[1]))
    return np.array(rows).T


def test_levant_s_first_order_differentiator_agrees():
    """Theirs starts at 0, as sin t does, and gives the state after the sample's step: ours one sample later."""
    theirs = estimators.LevantDifferentiator(order=1, L=4.0, dt=H)
    ours, other = estimated(estimator("levant", L=4.0, order=1), theirs, H, 3.0)
    np.testing.assert_allclose(ours[1:], other[:-1], atol=1e-12)


@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("high_gain", lambda h: estimators.HighGainObserver(alpha1=1.0, alpha2=2.0, epsilon=0.05, dt=h)),
        ("extended_state_observer", lambda h: estimators.ExtendedStateObserver(3.0, 3.0, 1.0, 0.05, dt=h)),
        ("integral_chain", lambda h: estimators.IntegralChainDifferentiator(order=2, epsilon=0.05, dt=h)),
    ],
)
def test_linear_observers_agree_to_the_order_of_the_period(name, make):
    """Theirs are explicit Euler steps of the same equations, w = 1 / epsilon; ours are exact or as good."""
    apart = []
    for h in (2e-3, 2e-4):
        ours, other = estimated(estimator(name, w=20.0), make(h), h, 3.0)
        apart.append(np.abs(ours - other)[len(ours) // 2 :].max())
    assert apart[1] < 3e-3
    assert apart[0] / apart[1] == pytest.approx(10.0, rel=0.2)


# where theirs are wrong


def ride(controller, x0=(1.0, 0.0), T=5.0, dt=H, d=0.0, ref=None, plant=None):
    """A run of theirs on their double integrator."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return simulator.Simulator(dt=dt, T=T).run(
            controller, plant or plants.DoubleIntegrator(), ref, utils.step_disturbance(d), np.array(x0)
        )


@pytest.mark.parametrize("name", ["TwistingSMC", "QuasiContinuous2SMC"])
def test_wrong_relative_degree_their_2_sliding_laws_act_on_a_variable_of_degree_1(name):
    """sigma = c e + e' has sigma' = c e' + e'': u enters the first derivative, and c e' is not sigma'.

    There is no 2-sliding: the error dies out as exp(-c t) at best, where on sigma = e the same law ends it in finite
    time.
    """
    make = getattr(controllers, name)
    gains = {"r1": 6.0, "r2": 4.0} if name == "TwistingSMC" else {"alpha": 6.0, "beta": 2.0}
    published, right = ride(make(c=1.0, **gains)), ride(make(c=1.0, surface=Itself(), **gains))
    late = published["t"] > 4.0
    assert np.abs(published["x"][late, 0]).max() > 0.5 * math.exp(-4.0)
    assert np.abs(right["x"][late, 0]).max() < 1e-4


def test_the_integral_of_their_integral_surface_is_never_updated():
    """s is s0(t) - s0(0) at all times: on s = 0, de + c e = c e(0), and the error stays where it began."""
    theirs = surfaces.IntegralSlidingSurface(c=2.0)
    values = [theirs.compute(1.0, 0.0, t=k * H) for k in range(1000)]
    assert values == [0.0] * 1000
    assert theirs._integral == 0.0
    stuck = ride(controllers.ClassicalSMC(surface=surfaces.IntegralSlidingSurface(c=2.0)), T=3.0)
    assert stuck["x"][-1, 0] == pytest.approx(1.0, abs=1e-3)
    free = smc.plant("duffing", alpha=0.0, beta=0.0, delta=0.0)
    common = {"law": "exponential_reaching", "model": "nominal", "surface": "integral", "x0": 1.0, "duration": 5.0}
    assert abs(smc.run(smc.Scenario(plant=free, **common)).x[-1, 0]) < 0.05


def test_flipped_sign_their_integral_terminal_law_diverges_with_a_reaching_law():
    """Reaching laws give -k sgn(s); it adds that where s' = ... - u asks for the opposite."""
    own = ride(controllers.ITSMC(), T=3.0)
    given = ride(controllers.ITSMC(reaching=reaching.ExponentialRate(k=5.0, q=3.0)), T=3.0)
    assert abs(own["x"][-1, 0]) < 0.05
    assert abs(given["x"][-1, 0]) > 100.0


@pytest.mark.parametrize(
    ("make", "state", "rate"),
    [
        (lambda: controllers.ClassicalSMC(c=2.0, reaching=reaching.SuperTwisting(k2=3.0)), lambda c: c.reaching.z, 3.0),
        (lambda: controllers.AdaptiveSMC(c=2.0, gamma=1.5, eta0=0.0), lambda c: c._eta, 3.0),
        (lambda: controllers.PID(Ki=1.0), lambda c: c._e_int[0], -1.0),
    ],
    ids=["SuperTwisting", "AdaptiveSMC", "PID"],
)
def test_stored_dt_their_memories_run_by_a_period_of_their_own(make, state, rate):
    """On a mass that does not move s = -2 and e = -1 for a second; the simulator's dt is 10 ms, theirs 0.1 ms."""
    controller = make()
    ride(controller, T=1.0, dt=1e-2, plant=plants.DoubleIntegrator(J=1e12))
    assert state(controller) == pytest.approx(rate * 1.0 * 1e-2, rel=0.02)  # a hundredth of what a second makes
    for dt in (1e-3, 1e-2):
        law = Ours(smc.law("super_twisting", k1=0.0, k2=3.0), dt=dt)
        for _ in range(round(1.0 / dt)):
            law(de=-2.0)
        assert law.memory[0] == pytest.approx(3.0, rel=1e-9)


def test_a_negative_period_is_taken_and_runs_the_memory_backwards():
    theirs = reaching.SuperTwisting(k1=0.0, k2=3.0, dt=-1.0)
    assert [theirs.compute(1.0) for _ in range(3)] == [0.0, 3.0, 6.0]  # away from s = 0
    with pytest.raises(smc.ScenarioError, match="control_period"):
        smc.Scenario(plant="duffing", law="super_twisting", control_period=-1.0)


def test_their_adaptive_law_ignores_how_fast_the_reference_moves():
    """On the reference, with its speed, e = de = 0: u should be 0, and is -c x'."""
    u, info = controllers.AdaptiveSMC(c=10.0).compute(0.0, np.array([0.3, 2.0]), np.array([0.3, 2.0]))
    assert (info["e"], info["edot"]) == (0.0, 0.0)
    assert u == -20.0
    law = Ours(smc.law("adaptive", c=10.0), model=1.0)
    assert law(0.0, 0.0, x=0.3, v=2.0, r=0.3, dr=2.0)[0] == 0.0


def test_their_dynamic_law_ignores_the_reference():
    """Its sigma is made of x, not of e: asked for 1 it goes to 0."""
    asked = ride(controllers.DynamicSMC(dt=H), x0=(0.5, 0.0), T=5.0, ref=lambda t: np.array([1.0, 0.0]))
    assert abs(asked["x"][-1, 0]) < 0.05


def test_their_nested_law_of_order_3_is_not_homogeneous():
    """N_(1,3) is |sigma|^(2/3) (Levant 2003, eq. 7: exponent (r - i)/q); theirs is |sigma|^(1/3), exponent 1/q.

    Under (sigma, sigma', sigma'') -> (k^3 sigma, k^2 sigma', k sigma'') u must not change.
    """
    theirs = controllers.NestedHOSMC(order=3, alpha=1.0, betas=[1.0, 2.0], g_sign=1.0)
    ours = Ours(smc.law("nested_third_order", a=1.0, w=1.0))
    states, k = np.random.default_rng(1).normal(size=(2000, 3)), 1e-2
    scaled = states * (k**3, k**2, k)

    def u(z):
        return theirs.compute(0.0, None, None, sigma_derivs=list(z))[0]

    def mine(z):
        return ours(z[0], z[1], a=z[2])[0]

    assert sum(u(a) != u(b) for a, b in zip(states, scaled, strict=True)) > 100
    assert sum(mine(a) != mine(b) for a, b in zip(states, scaled, strict=True)) == 0
    assert theirs._compute_psi([1e-6, -2e-4, 0.0]) == 1.0  # sigma' + |sigma|^(1/3) > 0, where it is
    assert mine([1e-6, -2e-4, 0.0]) == 1.0  # sigma' + |sigma|^(2/3) < 0: the other way


@pytest.mark.parametrize("make", [surfaces.FastTerminalSurface, controllers.NFTSMC])
def test_their_fast_terminal_surfaces_end_no_error_in_finite_time(make):
    """Their power of e exceeds 1: near 0 the linear term alone is left, and e dies out as exp(-alpha t).

    Yu & Man's power is below 1 (the same in ours): e' = -a e - b [e]^p ends at ln(1 + a |e0|^(1-p)/b)/(a (1-p)).
    """
    theirs = make()
    power = theirs.q / theirs.p if hasattr(theirs, "q") else theirs.gamma

    def last(a, b, p, T=20.0, h=1e-3):
        e = 1.0
        for _ in range(round(T / h)):
            e -= h * (a * e + b * e**p)
            if e <= 0.0:
                return 0.0
        return e

    assert power > 1.0
    assert last(theirs.alpha, theirs.beta, power) > 0.0
    assert last(1.0, 1.0, 0.6, T=math.log(2.0) / 0.4 + 0.01) == 0.0


def test_their_quasi_sliding_band_is_no_bound():
    """A sample just above s = 0 lands eps Ts below: twice the band stated, which is the amplitude of a 2-cycle.

    Gao, Wang & Homaifa 1995: the band is eps Ts / (1 - q Ts).
    """
    law = controllers.DiscreteSMC(c=2.0, q_rate=10.0, epsilon=5.0, Ts=0.01)
    e, de = 0.0, 1e-9
    u = controlled(law)(e, de)
    after = (de + 0.01 * u) + 2.0 * (e + 0.01 * de + 0.5 * 0.01**2 * u)
    assert after == pytest.approx(-5.0 * 0.01, rel=1e-3)
    assert abs(after) > 1.8 * law.quasi_sliding_band
    assert abs(after) < 5.0 * 0.01 / (1.0 - 10.0 * 0.01)


def test_their_random_disturbance_depends_on_how_often_it_is_asked():
    force = utils.random_band()
    assert force(0.5)[1] != force(0.5)[1]


def result(e, s=None, dt=0.1):
    """What their metrics read."""
    t = np.arange(len(e)) * dt
    return {"t": t, "e": np.array(e)[:, None], "s": np.array(e if s is None else s)[:, None]}


def test_their_settling_time_is_0_for_nan_and_the_end_for_never():
    assert metrics.settling_time(result([math.nan] * 100)) == 0.0
    assert metrics.settling_time(result([1.0] * 100)) == pytest.approx(9.9)


def test_their_reaching_time_is_the_first_touch_and_the_end_for_never():
    """s passes through 0 once and leaves for good."""
    through = np.linspace(1.0, -9.0, 101)
    assert metrics.reaching_time(result(through)) == pytest.approx(1.0)
    assert metrics.reaching_time(result([1.0] * 100)) == pytest.approx(9.9)


def test_their_simulator_returns_a_diverged_run_in_silence():
    """The same instability of this package's law is named, with its time."""
    lost = ride(controllers.PID(Kp=-500.0, Kd=-500.0), T=2.0)
    assert not np.all(np.isfinite(lost["x"])) or np.abs(lost["x"]).max() > 1e100
    law = smc.law("computed_torque", kp=1e-3, kd=1e-3)
    plant = smc.plant("duffing", delta=-500.0)
    ours = smc.run(smc.Scenario(plant=plant, law=law, x0=1.0, duration=2.0))
    assert ours.failure is not None
    assert ours.diverged_at is not None
