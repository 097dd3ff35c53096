"""A friction by a user's function: it rests, holds and breaks away where its level says, and what
cannot hold is named before a run.
"""

import math
import sys

import numpy as np
import pytest
from helpers import reference
from helpers.runs import assert_same, free_mass
from numba import njit

import smc_mujoco as smc
from smc_mujoco.analysis.engine import group
from smc_mujoco.hardware import friction_function

NUMBERS = {"coulomb": 0.2, "static": 0.5, "speed": 0.1}


@friction_function(numbers=NUMBERS)
def stribeck(y, p, memory):
    return p.coulomb + (p.static - p.coulomb) * math.exp(-((y.v / p.speed) ** 2))


@friction_function(numbers=NUMBERS)
def bounded(y, p, memory):
    level = p.coulomb + (p.static - p.coulomb) * math.exp(-((y.v / p.speed) ** 2))
    return math.copysign(level, y.v), -p.static, p.static


@friction_function(numbers={"level": 0.4, "rate": 1.0}, memory=1)
def warming(y, p, memory):
    """Dry friction that falls with time, of which it keeps the count."""
    level = p.level * math.exp(-p.rate * memory[0])
    memory[0] += y.h
    return math.copysign(level, y.v), -level, level


@friction_function(numbers={"b": 0.4})
def viscous(y, p, memory):
    return p.b * abs(y.v)


@smc.law_function(gains={"kp": 20.0, "kd": 3.0})
def pd(y, gains, memory):
    return -gains.kp * y.e - gains.kd * y.de, y.e


def exact_rest(x, kp, kd, numbers, inertia=1.0, seconds=4.0):
    """Where a joint under a PD law comes to rest, by steps of 10 us with an exact stop; the law
    samples each ms.
    """
    h, v, u = 1e-5, 0.0, 0.0
    for k in range(round(seconds / h)):
        if k % 100 == 0:
            u = -kp * x - kd * v
        if v == 0.0 and abs(u) <= numbers["static"]:
            continue
        sign = math.copysign(1.0, v if v else u)
        drop = math.exp(-((v / numbers["speed"]) ** 2))
        level = numbers["coulomb"] + (numbers["static"] - numbers["coulomb"]) * drop
        new = v + h * (u - sign * level) / inertia
        if v * new < 0.0:
            new = 0.0
        x += 0.5 * h * (v + new)
        v = new
    return x


def cart(**fields):
    """A run of a cart of 1 kg without a spring."""
    plant = free_mass()
    return smc.run(
        smc.Scenario(plant=plant, **{"law": "none", "x0": 0.0, "v0": 0.0, "u_max": 99.0} | fields)
    )


@pytest.mark.parametrize("kind", [stribeck, bounded])
@pytest.mark.parametrize(("kp", "kd"), [(20.0, 3.0), (45.0, 4.0)])
def test_it_rests_where_exact_steps_rest(kind, kp, kd):
    trace = cart(friction=kind(), law=pd(kp=kp, kd=kd), x0=1.0, duration=4.0)
    truth = exact_rest(1.0, kp, kd, NUMBERS)
    assert abs(truth) > 2e-3
    assert abs(trace.v[-1, 0]) < 1e-9
    assert trace.x[-1, 0] == pytest.approx(truth, rel=0.01)


@pytest.mark.quick
@pytest.mark.parametrize("kind", [stribeck, bounded])
def test_it_holds_at_90_percent_of_its_breakaway_and_not_above(kind):
    held, gone = (
        cart(friction=kind(), feedforward=smc.Constant(share * 0.5), duration=10.0)
        for share in (0.9, 1.01)
    )
    assert np.abs(held.x).max() < 1e-12
    assert gone.x[-1, 0] > 1.0


def test_a_level_is_the_friction_of_the_library_with_its_numbers():
    theirs = smc.hardware.ServoFriction(kc=0.2, kcs=0.3, vs=0.1, alpha=2.0)
    fields = {"law": smc.law("pid"), "disturbance": smc.Sine(0.5, 5.0), "duration": 2.0}
    ours, same = (cart(friction=part, **fields) for part in (stribeck(), theirs))
    np.testing.assert_allclose(ours.x, same.x, atol=1e-9)
    double = smc.plant("double_pendulum")
    fields["law"] = smc.law("computed_torque")
    ours, same = (
        smc.run(smc.Scenario(plant=double, friction=part, **fields))
        for part in (stribeck(), theirs)
    )
    np.testing.assert_allclose(ours.x, same.x, atol=1e-9)


def test_a_smooth_level_is_its_force_against_the_motion():
    trace = cart(friction=viscous(), v0=1.0, duration=2.0)
    np.testing.assert_allclose(trace.v[:, 0], np.exp(-0.4 * trace.t), rtol=1e-10)


@friction_function(numbers={"cold": 0.4, "warm": 0.1, "after": 1.0})
def gearbox(y, p, memory):
    return p.warm if y.t >= p.after else p.cold


def test_a_level_may_fall_in_mid_run():
    trace = cart(friction=gearbox(), feedforward=smc.Constant(0.3), duration=2.0)
    free = np.maximum(trace.t - 1.0, 0.0)
    np.testing.assert_allclose(trace.x[:, 0], 0.5 * 0.2 * free**2, atol=3e-4)
    assert np.abs(trace.x[:1000]).max() < 1e-12


@friction_function(numbers=NUMBERS)
def with_time(y, p, memory):
    level = p.coulomb + (p.static - p.coulomb) * math.exp(-((y.v / p.speed) ** 2))
    return level if y.t >= 0.0 else p.static


@njit
def speed_of(y):
    return y.v


@friction_function(numbers=NUMBERS)
def by_helper(y, p, memory):
    return p.coulomb + abs(speed_of(y))


@friction_function(numbers=NUMBERS)
def renamed(y, p, memory):
    joint = y
    return p.coulomb + abs(joint.v)


@friction_function(numbers=NUMBERS)
def by_place(y, p, memory):
    return p.coulomb + abs(y[3])


SHARED = 0.2


@friction_function(numbers={"more": 0.0})
def of_file(y, p, memory):
    return SHARED + p.more + 0.0 * y.v


@friction_function(numbers=NUMBERS)
def without_rest(y, p, memory):
    if y.v == 0.0:
        raise ValueError("no level at rest")
    return p.coulomb


@pytest.mark.parametrize(
    ("kind", "known"),
    [
        (stribeck, True),
        (viscous, True),
        (with_time, False),
        (by_helper, False),
        (renamed, False),
        (by_place, False),
        (of_file, False),
        (bounded, False),
        (warming, False),
        (without_rest, False),
    ],
)
def test_levels_at_rest_are_numbers_of_what_reads_the_speed_alone(kind, known):
    assert ("level_at_0" in kind().names) == known


def test_a_level_is_the_same_whether_it_is_known_or_called():
    """It differs a little where the other forces alone stop the joint."""
    fields = {"law": smc.law("pid"), "disturbance": smc.Sine(3.0, 60.0), "duration": 2.0}
    numbers = {"coulomb": (0.4,), "static": (0.5,), "speed": 0.1}
    of_speed, called = (cart(friction=kind(**numbers), **fields) for kind in (stribeck, with_time))
    assert np.abs(of_speed.x).max() > 2e-3
    np.testing.assert_allclose(of_speed.x, called.x, atol=2e-8)


def test_a_joint_rests_and_slides_by_one_value_of_a_variable_that_changes(monkeypatch):
    """Compiled code keeps the value that the variable had."""
    for value in (0.5, 0.1):
        monkeypatch.setattr(sys.modules[__name__], "SHARED", value)
        for more in (0.0, 0.01):
            friction = of_file(more=more)
            lost_speed = 1.0 - cart(friction=friction, v0=1.0, duration=1.0).v[-1, 0]
            held = cart(
                friction=friction, feedforward=smc.Constant(0.99 * lost_speed), duration=1.0
            )
            gone = cart(
                friction=friction, feedforward=smc.Constant(1.01 * lost_speed), duration=1.0
            )
            assert np.abs(held.x).max() < 1e-12
            assert gone.x[-1, 0] > 1e-4


def test_what_raises_at_rest_says_so_in_its_run():
    failure = cart(friction=without_rest(), v0=0.1, duration=1.0).failure
    assert "raised" in str(failure)


def test_a_memory_moves_once_a_step():
    trace = cart(friction=warming(), v0=2.0, duration=1.0)
    expected = -0.4 * np.exp(-trace.t[:-1])
    np.testing.assert_allclose(trace.reaction[1:, 0], expected, rtol=2e-3)


@pytest.mark.parametrize("kind", [stribeck, bounded, viscous])
@pytest.mark.parametrize("plant", ["duffing", "double_pendulum"])
def test_the_reference_loop_has_the_same_bits(kind, plant):
    fields = {"law": smc.law("classical"), "disturbance": smc.Sine(0.5, 5.0), "duration": 0.3}
    rubbing = smc.Scenario(plant=plant, friction=kind(), **fields)
    assert_same(smc.run(rubbing), reference.run(rubbing))


@friction_function(numbers={"forward": 0.2, "backward": 0.5})
def one_sided(y, p, memory):
    return p.forward if y.v > 0.0 else p.backward


@pytest.mark.parametrize("kind", [stribeck, viscous, one_sided])
def test_the_reference_loop_has_the_same_bits_where_other_forces_turn_a_joint(kind):
    fields = {"law": "none", "disturbance": smc.Sine(30.0, 200.0), "duration": 0.3}
    rubbing = smc.Scenario(plant="duffing", friction=kind(), **fields)
    assert_same(smc.run(rubbing), reference.run(rubbing))


@pytest.mark.parametrize("kind", [stribeck, bounded, warming])
def test_the_fast_engine_runs_it(kind):
    fields = {"law": smc.law("pid"), "disturbance": smc.Sine(0.5, 5.0), "duration": 0.5}
    rubbing = smc.Scenario(plant="duffing", friction=kind(), **fields)
    assert group.why_not(rubbing, ("itae",)) == ""
    trace = smc.run(rubbing)
    scored = group.FormGroup([rubbing], ("itae",)).scored("cpu", 1)[0][0][0]
    assert scored == pytest.approx(smc.score(trace)["itae"], rel=1e-9)


@friction_function()
def signed(y, p, memory):
    return -math.copysign(0.2, y.v)


@friction_function(numbers={"eps": 1e-5})
def steep(y, p, memory):
    return -0.2 * math.tanh(y.v / p.eps)


@friction_function()
def nothing_at_rest(y, p, memory):
    return 0.2 if y.v else 0.0


@friction_function()
def pushing(y, p, memory):
    return 0.2 * y.v


@friction_function(numbers={"b": 0.4})
def signed_viscous(y, p, memory):
    return -p.b * y.v


@friction_function()
def below_zero(y, p, memory):
    return 0.2 if y.v else -0.1


@friction_function()
def smooth(y, p, memory):
    return 0.2 * abs(math.tanh(y.v / 1e-2))


@friction_function()
def crossed(y, p, memory):
    return 0.2 * y.v, 0.1, -0.1


@friction_function(memory=1)
def remembered_sign(y, p, memory):
    return -math.copysign(0.2 + memory[0], y.v)


@friction_function(memory=1)
def remembered_level(y, p, memory):
    return 0.2 + memory[0]


def test_a_number_may_not_have_the_name_of_a_level_beside_rest():
    with pytest.raises(smc.ScenarioError, match="level_at_0"):
        friction_function(numbers={"level_at_0": 1.0})(lambda y, p, memory: p.level_at_0)


@friction_function()
def two(y, p, memory):
    return 0.1, 0.2


@pytest.mark.parametrize(
    ("part", "words"),
    [
        (signed(), "flips .* return its level"),
        (steep(), "flips .* return its level"),
        (nothing_at_rest(), "0 at v = 0, .* return the level at v = 0"),
        (pushing(), "is -2e-05 just below v = 0: return a level of 0 or more"),
        (signed_viscous(), "is -4e-05 just above v = 0: return a level of 0 or more"),
        (below_zero(), "is -0.1 at v = 0: return a level of 0 or more"),
        (crossed(), "low 0.1 and high -0.1"),
        (remembered_sign(), "holds no joint at rest: return F, low, high"),
        (remembered_level(), "holds no joint at rest: return F, low, high"),
        (two(), "return its level, or F, low, high"),
    ],
)
def test_what_cannot_hold_is_named_before_the_run(part, words):
    with pytest.raises(smc.ScenarioError, match=words):
        smc.Scenario(plant="duffing", law="none", friction=part)


@friction_function()
def falling(y, p, memory):
    return 0.3 - 0.5 * abs(y.v)


@pytest.mark.parametrize("v0", [1.0, -1.0])
def test_a_level_that_becomes_negative_ends_a_run_in_both_directions(v0):
    failure = cart(friction=falling(), v0=v0).failure
    assert failure is not None
    assert "friction falling" in failure
    assert "it is negative: return a level of 0 or more" in failure


def test_a_smooth_level_that_is_0_at_rest_is_no_flip():
    assert cart(friction=smooth(), v0=0.5).failure is None
