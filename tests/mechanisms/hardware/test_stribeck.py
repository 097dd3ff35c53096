"""Stribeck friction: its formula, what holds a joint at rest in each direction, and published servos
as parts.
"""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.runs import free_mass

import smc_mujoco as smc
from smc_mujoco.hardware import LuGre, Stribeck
from smc_mujoco.mechanisms.hardware.servos import SERVOS, SUPPLIES

PART = Stribeck(0.2, 0.35, 0.1, viscous=0.3, offset=0.05)


def cart(**fields):
    """A run of a cart of 1 kg without a spring."""
    plant = free_mass()
    return smc.run(smc.Scenario(plant=plant, **{"law": "none", "x0": 0.0, "v0": 0.0} | fields))


@pytest.mark.quick
@pytest.mark.parametrize("v", [-1.0, -0.07, 0.03, 0.4])
@pytest.mark.parametrize("width", [0.0, 0.02])
def test_its_force_is_the_formula(v, width):
    part = Stribeck(0.2, 0.35, 0.1, viscous=0.3, offset=0.05, width=width)
    p = SimpleNamespace(**dict(zip(part.names, part.parameters(0), strict=True)))
    step = math.tanh(v / width) if width else math.copysign(1.0, v)
    expected = (0.2 + 0.15 * math.exp(-((v / 0.1) ** 2))) * step + 0.3 * v + 0.05
    force, low, high = part.value(v, 0.0, 0.0, p)
    assert force == pytest.approx(expected, rel=1e-14)
    assert (low, high) == pytest.approx((0.05 - 0.35, 0.05 + 0.35))


@pytest.mark.parametrize(("sign", "most"), [(1.0, 0.4), (-1.0, 0.3)])
@pytest.mark.parametrize("plant", ["alone", "together"])
def test_each_direction_breaks_away_at_its_own_level(sign, most, plant):
    for share, moves in ((0.99, False), (1.03, True)):
        push = {"feedforward": smc.Constant(sign * share * most), "friction": PART, "duration": 3.0}
        if plant == "together":
            slide = {"slide": PART}
            hanging = smc.plant("overhead_crane", M=1.0, m=1e-3)
            push |= {"plant": hanging, "law": "none", "x0": (0.0, 0.0), "friction": slide}
            trace = smc.run(smc.Scenario(**push))
        else:
            trace = cart(**push)
        assert (abs(trace.x[-1, 0]) > 1e-2) == moves
        assert moves or abs(trace.x[-1, 0]) < 1e-4


def test_an_offset_larger_than_the_friction_drives_the_joint():
    for sign in (1.0, -1.0):
        trace = cart(friction=Stribeck(0.1, offset=-0.3 * sign), duration=2.0)
        np.testing.assert_allclose(sign * trace.x[:, 0], 0.5 * 0.2 * trace.t**2, atol=1e-9)
    friction = {"slide": Stribeck(0.1, offset=0.3)}
    hanging = smc.plant("overhead_crane", M=1.0, m=1e-6)
    trace = smc.run(
        smc.Scenario(plant=hanging, law="none", x0=(0.0, 0.0), friction=friction, duration=2.0)
    )
    assert trace.x[-1, 0] == pytest.approx(-0.4, rel=1e-2)


def test_without_a_drop_it_is_coulomb_and_viscous_friction_and_a_force():
    fields = {"law": smc.law("pid"), "disturbance": smc.Sine(0.5, 5.0), "duration": 2.0}
    ours = cart(friction=Stribeck(0.2, offset=0.05), **fields)
    fields["disturbance"] = smc.Sine(0.5, 5.0), smc.Constant(-0.05)
    np.testing.assert_allclose(ours.x, cart(friction=smc.Coulomb(0.2), **fields).x, atol=1e-9)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Stribeck(0.2, 0.1, 0.1), "static 0.1 is less than its coulomb 0.2"),
        (lambda: Stribeck((0.1, 0.3), (0.2, 0.2), 0.1), "is less than its coulomb"),
        (lambda: Stribeck(0.2, 0.3), "no stribeck"),
        (lambda: Stribeck(-0.2), "coulomb is -0.2"),
    ],
)
def test_numbers_that_no_friction_has_are_refused(make, words):
    with pytest.raises(smc.ScenarioError, match=words):
        make()


def test_a_steady_speed_needs_the_force_of_the_bristles_that_are_alike():
    y = SimpleNamespace(v=0.07)
    theirs = LuGre(0.2, 0.35, 0.1).steady(
        y, SimpleNamespace(coulomb=0.2, static=0.35, stribeck=0.1), None
    )
    p = SimpleNamespace(
        **dict(zip(PART.names, Stribeck(0.2, 0.35, 0.1).parameters(0), strict=True))
    )
    assert PART.value(0.07, 0.0, 0.0, p)[0] == pytest.approx(theirs, rel=1e-14)


@pytest.mark.parametrize("name", SERVOS)
def test_a_published_servo_moves_and_stalls_at_its_numbers(name):
    model = "m4" if "m4" in SERVOS[name] else "m1"
    servo = smc.hardware.servo(name, model)
    fitted = SERVOS[name][model]
    supply = SUPPLIES[name]
    stall = min(fitted["kt"] * supply.voltage / fitted["R"], fitted["kt"] * supply.current)
    assert servo.motor.stall == pytest.approx(stall, rel=1e-12)
    assert servo.motor.rotor_inertia == fitted["armature"]
    assert servo.friction.kc == fitted["friction_base"]
    parts = {"actuator": servo.motor, "friction": servo.friction}
    assert cart(**parts, feedforward=smc.Constant(stall), duration=1.0).x[-1, 0] > 0.01


def test_friction_grows_with_what_the_gearbox_carries():
    """A motor that holds 3 N m against a load of 3 N m has |motor - load| = 6: by hand, and as a
    servo's model M3 has it.
    """
    share = smc.hardware.Stribeck(0.2, km=0.05)
    f, low, high = share.value(0.4, 3.0, -3.0, SimpleNamespace(**fields_of(share)))
    assert f == pytest.approx(0.2 + 0.05 * 6.0)
    assert (low, high) == pytest.approx((-f, f))
    runs = []
    for friction in (share, smc.hardware.ServoFriction(kc=0.2, km=0.05, ke=0.05)):
        runs.append(
            smc.run(
                smc.Scenario(
                    plant="inverted_pendulum",
                    law=smc.law("pid", kp=60.0, ki=0.0, kd=6.0),
                    friction=friction,
                    x0=0.4,
                    duration=1.0,
                )
            )
        )
    np.testing.assert_array_equal(runs[0].x, runs[1].x)
    plain = dataclasses.replace(runs[0].scenario, friction=smc.hardware.Stribeck(0.2))
    assert np.abs(smc.run(plain).x - runs[0].x).max() > 1e-3


def fields_of(part):
    return {
        field.name: math.nan if (value := getattr(part, field.name)) is None else value
        for field in dataclasses.fields(part)
        if not field.kw_only
    }
