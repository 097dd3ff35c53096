"""Our laws against opensmc 2.0.0's own functions where those are right.

opensmc counts its error the other way round, e = r - x, and its default plant is x'' = u + d: at r
= 0 its controllers' u is ours with the nominal model f = 0, g = 1; its reaching laws give our
model-free u. Left out where opensmc is not installed.
"""

import numpy as np
import pytest
from helpers.plants_ab import called, measured

import smc_mujoco as smc
from smc_mujoco.control.surface import surface

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
STATES = np.random.default_rng(0).normal(
    scale=(1.0, 2.0),
    size=(400, 2),
)


def own(component, **given):
    """A law or a surface of this package with its memory, as a function."""
    memory = np.zeros(component.memory)
    return lambda e=0.0, de=0.0, **more: called(
        component, measured(e, de, **(given | more)), memory
    )


def along(ours, theirs, states=STATES, rtol=1e-12):
    """Fail unless two functions of (e, de) agree at one state after the other, memories and all."""
    for e, de in states.tolist():
        assert ours(e, de) == pytest.approx(
            theirs(e, de),
            rel=rtol,
            abs=1e-12,
        )


def controlled(controller, **more):
    """u of a controller of theirs at r = 0."""
    return lambda e, de: float(controller.compute(0.0, np.array([e, de]), np.zeros(2), **more)[0])


# reaching laws: ours without the model, on s


@pytest.mark.quick
@pytest.mark.parametrize(
    ("law", "theirs"),
    [
        (smc.law("classical", k=2.0), lambda: reaching.ConstantRate(k=2.0)),
        (
            smc.law(
                "exponential_reaching",
                k=2.0,
                q=3.0,
            ),
            lambda: reaching.ExponentialRate(k=2.0, q=3.0),
        ),
        (smc.law("power_rate", k=2.0, a=0.7), lambda: reaching.PowerRate(k=2.0, alpha=0.7)),
        (smc.law("boundary_layer", k=2.0, phi=0.4), lambda: reaching.Saturation(k=2.0, phi=0.4)),
        (
            smc.law("super_twisting", k1=2.0, k2=3.0),
            lambda: reaching.SuperTwisting(
                k1=2.0,
                k2=3.0,
                dt=H,
            ),
        ),
    ],
    ids=lambda v: getattr(v, "name", ""),
)
def test_reaching_laws_agree(law, theirs):
    ours = own(law)
    of_opensmc = theirs()
    along(lambda e, de: ours(0.0, de)[0], lambda e, de: of_opensmc.compute(de))


# controllers: ours with the model, on e and de


@pytest.mark.parametrize(
    ("law", "theirs"),
    [
        (
            smc.law(
                "exponential_reaching",
                k=1.1,
                q=4.0,
                c=3.0,
            ),
            lambda: controllers.ClassicalSMC(
                c=3.0,
                k=4.0,
                eta=1.1,
            ),
        ),
        (
            smc.law(
                "fixed_time",
                k1=2.0,
                k2=3.0,
                a=0.6,
                b=1.4,
                k=0.0,
                c=3.0,
            ),
            lambda: controllers.FixedTimeSMC(
                c=3.0,
                alpha=2.0,
                beta=3.0,
                p=0.6,
                q=1.4,
            ),
        ),
        (
            smc.law(
                "discrete_reaching",
                eps=2.0,
                q=3.0,
                c=2.5,
            ),
            lambda: controllers.DiscreteSMC(
                c=2.5,
                q_rate=3.0,
                epsilon=2.0,
                Ts=H,
                u_max=1e9,
            ),
        ),
        (
            smc.law("lqr", q1=10.0, q2=2.0, r=0.5),
            lambda: controllers.LQR(
                [[0, 1], [0, 0]], [[0], [1]], Q=np.diag([10.0, 2.0]), R=[[0.5]]
            ),
        ),
        (
            smc.law(
                "pid",
                kp=5.0,
                ki=0.0,
                kd=2.0,
                tau=0.0,
            ),
            lambda: controllers.PID(Kp=5.0, Kd=2.0),
        ),
        (smc.law("computed_torque", kp=5.0, kd=2.0), lambda: controllers.PID(Kp=5.0, Kd=2.0)),
    ],
    ids=lambda v: getattr(v, "name", ""),
)
def test_controllers_agree(law, theirs):
    ours = own(law, model=1.0)
    controller = controlled(theirs())
    along(lambda e, de: ours(e, de)[0], controller, rtol=1e-9)


# surfaces and estimators


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (surface("linear", c=3.0), lambda: surfaces.LinearSurface(c=3.0)),
        (
            surface("terminal", b=2.0, p=5 / 7),
            lambda: surfaces.TerminalSurface(
                beta=2.0,
                p=5,
                q=7,
            ),
        ),
        (
            surface(
                "nonsingular_terminal",
                B=2.0,
                p=7 / 5,
            ),
            lambda: surfaces.NonsingularTerminalSurface(2.0, 5, 7),
        ),
    ],
    ids=lambda v: getattr(v, "name", ""),
)
def test_surfaces_agree(ours, theirs):
    mine = own(ours)
    surface_of_opensmc = theirs()
    along(lambda e, de: mine(e, de)[0], lambda e, de: float(surface_of_opensmc.compute(e, de)))
