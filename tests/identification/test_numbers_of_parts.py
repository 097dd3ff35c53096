"""Numbers of a motor, of a friction with bristles, and of a motor's and an encoder's scale, by their
paths, from logs of an integration of the joint's own equation or of MuJoCo alone.
"""

import math

import numpy as np
import pytest
from helpers.machine_logs import chain, log, sines

import smc_mujoco as smc

STEP = 5e-5  # s
RATE = 500.0  # Hz
ONE = chain([0.4], [1.0])
MOTION = sines([0.0], [0.5, 0.3, 0.15], [0.4, 1.1, 2.7])


def joint_log(inertia, torque, kp, kd, duration=4.0):
    """A log of inertia a = torque(u, v, memory, step) - m g l sin x under a PD loop at 500 Hz."""
    random = np.random.default_rng(0)
    weight = 9.81 * 0.2
    x = v = last = rate = u = 0.0
    memory = [0.0]
    rows = []
    for k in range(round(duration / STEP)):
        if k % round(1.0 / RATE / STEP) == 0:
            y = x + 2e-4 * random.standard_normal()
            y = 2.0 * math.pi / 4096 * round(y * 4096 / 2.0 / math.pi)
            rate += 0.4 * ((y - last) * RATE - rate)
            last = y
            r, dr = (float(part[0]) for part in MOTION(k * STEP))
            u = kp * (r - y) + kd * (dr - rate)
            rows.append((k * STEP, y, u))
        after = v + STEP * (torque(u, v, memory) - weight * math.sin(x)) / inertia
        x += 0.5 * STEP * (v + after)
        v = after
    return dict(zip(("t", "x", "u"), np.array(rows).T, strict=True))


def check(found, truth, share):
    for name, true in truth.items():
        off = abs(found.values[name] - true)
        assert off <= max(2.0 * found.errors[name], share * true), name
        assert found.errors[name] < 10.0 * share * true, name  # or nothing was asked


@pytest.mark.slow
def test_a_motor_s_resistance_and_torque_constant_from_its_voltage():
    truth = {"actuator.resistance": 1.2, "actuator.torque_constant": 0.05}
    gear, rotor = 20.0, 2e-5
    arm = smc.plant_from(ONE, ["j1"])
    inertia = float(arm.load().dof_M0[0]) + gear**2 * rotor

    def torque(voltage, v, memory):
        k = gear * truth["actuator.torque_constant"]
        return k * (voltage - k * v) / truth["actuator.resistance"]

    run = joint_log(inertia, torque, 30.0, 1.0)
    motor = smc.DCMotor(1.0, 0.0, 0.04, gear, rotor, voltage=48.0, command="voltage")
    machine = smc.Scenario(plant=arm, law="none", actuator=motor)
    check(smc.identify(machine, run, list(truth)), truth, 0.01)


@pytest.mark.slow
def test_the_bristles_of_a_lugre():
    truth = {"friction.coulomb": 0.4, "friction.stiffness": 150.0, "j1.armature": 0.02}
    arm = smc.plant_from(ONE, ["j1"])
    inertia = float(arm.load().dof_M0[0]) + truth["j1.armature"]

    def torque(u, v, memory):
        (z,) = memory
        rate = v - truth["friction.stiffness"] * abs(v) / truth["friction.coulomb"] * z
        memory[0] = z + STEP * rate
        return u - truth["friction.stiffness"] * z - 2.0 * rate - 0.3 * v

    run = joint_log(inertia, torque, 20.0, 1.5)
    bristles = smc.hardware.LuGre(0.3, 0.3, 1.0, stiffness=400.0, damping=2.0)
    # static, which is not asked for, follows coulomb
    machine = smc.Scenario(plant=arm, law="none", friction=(bristles, smc.Viscous(0.3)))
    identified = smc.identify(machine, run, list(truth))
    stiffness = truth.pop("friction.stiffness")
    check(identified, truth, 0.02)
    # pieces start with unbent bristles, so it is found badly, and its error says so
    error = identified.errors["friction.stiffness"]
    assert abs(identified.values["friction.stiffness"] - stiffness) < 2.0 * error


@pytest.mark.slow
def test_a_gain_an_offset_and_where_the_encoder_reads_0():
    """Offset and zero are told apart by gravity alone, which the notes say."""
    truth = {"j1.frictionloss": 0.4, "j1.gain": 0.85, "j1.offset": 0.3, "j1.zero": 0.05}
    damped = ONE.replace('name="j1"', 'name="j1" damping=".3"')
    run = log(ONE, truth | {"j1.damping": 0.3}, MOTION, 20.0, 1.5, duration=4.0)
    run["x"] = run["x"] + truth["j1.zero"]
    identified = smc.identify(smc.plant_from(damped, ["j1"]), run, list(truth))
    check(identified, truth, 0.01)
    assert any("j1.offset and j1.zero are hardly told apart" in note for note in identified.notes)
