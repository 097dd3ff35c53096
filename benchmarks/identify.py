"""How well `smc.identify` finds numbers that are known, from logs of another simulation.

    python benchmarks/identify.py [MACHINE ...] [--seeds N]
    python benchmarks/identify.py --public FOLDER

The machines: `one`, `two` and `three` joints, a heavy pair `pair`, a joint with a Stribeck drop
`stribeck`, a cart with a pole `cart`. Their logs are of MuJoCo alone at steps of 0.1 ms, or of an
own integration (tests/helpers/machine_logs.py); fixed before any run: two errors or 1 % of one
joint, 2 % of two and three, 1 % of the pair and the level of the Stribeck joint, 5 % of the
frictions of the cart; at least 85 % of all numbers within two errors or 0.3 %.

FOLDER has the records of the AK80-6 pendulum and of double pendulum C.1, simple_pendulum-*.npz and
double_pendulum-C1-sysid-*.npz (DFKI, BSD-3).
"""

import argparse
import math
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

import smc_mujoco as smc
from smc_mujoco.identification.identify import held_out_fit
from smc_mujoco.identification.own_rig import own_rig

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from helpers.machine_logs import chain, chirp, log, sines, stairs
from public_logs import double_pendulum, double_pendulum_log, pendulum, pendulum_log

NO_CONTACT = 'contype="0" conaffinity="0"'
CART = f"""<mujoco model="cart"><compiler angle="radian"/><worldbody><body name="cart">
<joint name="slide" type="slide" axis="1 0 0"/>
<geom type="box" size=".1 .06 .05" mass=".8" {NO_CONTACT}/><body name="pole">
<joint name="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -.5" size=".01" mass=".2" {NO_CONTACT}/></body></body>
</worldbody><actuator><motor joint="slide"/></actuator></mujoco>"""
PAIR = """<mujoco model="pair"><compiler angle="radian"/><worldbody><body><body pos="0 .1 .2">
<joint name="lift" axis="0 1 0"/>
<inertial pos="0 0 .21" mass="8.4" diaginertia=".13 .13 .015"/><body pos="0 -.1 .42">
<joint name="elbow" axis="0 1 0"/>
<inertial pos="0 0 .2" mass="2.3" diaginertia=".03 .03 .004"/><body pos="0 0 .39">
<inertial pos="0 .1 .05" mass="2.6" diaginertia=".008 .008 .004"/></body></body></body></body>
</worldbody><actuator><motor joint="lift"/><motor joint="elbow"/></actuator></mujoco>"""
MACHINES: dict[str, dict[str, Any]] = {
    "one": {
        "xml": chain([0.4], [1.0]),
        "joints": ["j1"],
        "truth": {
            "j1.damping": 0.3,
            "j1.frictionloss": 0.4,
            "j1.armature": 0.02,
            "input_delay": 0.004,
        },
        "motion": sines([0.0], [0.5, 0.3, 0.15], [0.4, 1.1, 2.7]),
        "other": stairs([0.0], 0.35, 0.6),
        "log": {"kp": 20.0, "kd": 1.5, "duration": 8.0},
    },
    "two": {
        "xml": chain([0.35, 0.3], [1.2, 0.6]),
        "joints": ["j1", "j2"],
        "truth": {
            "j1.damping": 0.25,
            "j1.frictionloss": 0.5,
            "j1.armature": 0.03,
            "j2.damping": 0.08,
            "j2.frictionloss": 0.15,
            "j2.armature": 0.008,
            "j2.gain": 0.85,
            "input_delay": 0.006,
        },
        "motion": sines([0.0, 0.3], [0.5, 0.3, 0.12], [0.4, 1.1, 2.7]),
        "other": chirp([0.0, 0.2], 0.3, 0.2, 2.5, 8.0),
        "log": {"kp": [40.0, 15.0], "kd": [3.0, 0.8], "rate": 250.0, "counts": 8192},
    },
    "three": {
        "xml": chain([0.3, 0.3, 0.2], [1.5, 1.0, 0.5]),
        "joints": ["j1", "j2", "j3"],
        "truth": {
            "j1.damping": 0.4,
            "j1.frictionloss": 0.6,
            "j1.armature": 0.05,
            "j2.damping": 0.2,
            "j2.frictionloss": 0.3,
            "j2.armature": 0.02,
            "j3.damping": 0.05,
            "j3.frictionloss": 0.1,
            "j3.armature": 0.005,
            "input_delay": 0.002,
        },
        "motion": chirp([0.0, 0.4, -0.3], 0.4, 0.2, 2.5, 3.0),
        "other": sines([0.0, 0.3, -0.3], [0.4, 0.3, 0.1], [0.4, 1.1, 2.7]),
        "log": {
            "kp": [40.0, 40.0, 15.0],
            "kd": [3.0, 3.0, 0.6],
            "rate": 1000.0,
            "counts": 16384,
            "duration": 3.0,
        },
    },
    "pair": {
        "xml": PAIR,
        "joints": ["lift", "elbow"],
        "truth": {
            "lift.damping": 8.0,
            "lift.frictionloss": 9.0,
            "lift.armature": 1.2,
            "elbow.damping": 5.0,
            "elbow.frictionloss": 6.0,
            "elbow.armature": 0.8,
            "lift.offset": 1.5,
            "input_delay": 0.004,
        },
        "motion": sines([-1.0, 1.2], [0.4, 0.2, 0.08], [0.3, 0.9, 2.1]),
        "other": chirp([-1.0, 1.2], 0.25, 0.2, 2.0, 8.0),
        "log": {
            "kp": [2500.0, 900.0],
            "kd": [180.0, 60.0],
            "counts": 2**17,
            "noise": 2e-5,
            "x0": [-1.0, 1.2],
            "duration": 4.0,
        },
    },
    "cart": {
        "xml": CART,
        "joints": ["slide"],
        "measured": ["hinge"],
        "truth": {
            "slide.damping": 1.5,
            "slide.frictionloss": 0.8,
            "slide.armature": 0.15,
            "hinge.damping": 0.004,
            "hinge.frictionloss": 0.006,
            "input_delay": 0.008,
            "m": 1.1,
        },
        "motion": chirp([0.0], 0.12, 0.3, 2.2, 12.0),
        "other": sines([0.0], [0.12, 0.06], [0.5, 1.3]),
        "log": {
            "kp": 60.0,
            "kd": 8.0,
            "rate": 100.0,
            "duration": 5.0,
            "masses": {"cart": 1.1, "pole": 1.1},
        },
    },
}
STRIBECK = {
    "friction.kc": 0.3,
    "friction.kcs": 0.2,
    "friction.vs": 0.15,
    "friction.kv": 0.25,
    "j1.offset": 0.1,
    "input_delay": 0.005,
}
KINDS = "damping", "frictionloss", "armature"
KP, KD, STEP, RATE = 20.0, 1.5, 2e-5, 500.0  # of the joint with a Stribeck drop


@njit
def stribeck_joint(inertia, weight, numbers, r, dr, noise, quantum):
    """Return positions and commands of the joint, (K, 2), with exact stops between steps of 20
    us.
    """
    kc, kcs, vs, kv, offset, delay = numbers
    steps_per_sample = round(1.0 / RATE / STEP)
    late = round(delay / STEP)
    readings = np.zeros((len(r), 2))
    u = np.zeros(len(r))
    x = v = last = dy = 0.0
    share = 1.0 - math.exp(-1.0 / RATE / 4e-3)
    for k in range(len(r)):
        y = quantum * math.floor((x + noise[k]) / quantum + 0.5)
        if k:
            dy += share * ((y - last) * RATE - dy)
        last = y
        u[k] = KP * (r[k] - y) + KD * (dr[k] - dy)
        readings[k, 0], readings[k, 1] = y, u[k]
        for j in range(steps_per_sample):
            i = k * steps_per_sample + j - late
            force = (u[i // steps_per_sample] if i >= 0 else 0.0) + offset - weight * math.sin(x)
            if v == 0.0 and abs(force) <= kc + kcs:
                continue
            sign = math.copysign(1.0, v if v != 0.0 else force)
            friction = sign * (kc + kcs * math.exp(-((v / vs) ** 2))) + kv * v
            after = v + STEP * (force - friction) / inertia
            if v != 0.0 and after * v < 0.0:
                after = 0.0
            x += 0.5 * STEP * (v + after)
            v = after
    return readings


def stribeck_log(seed: int, motion: Any, inertia: float, duration: float = 8.0) -> dict:
    """Return a log of the joint with a Stribeck drop."""
    t = np.arange(round(duration * RATE)) / RATE
    r, dr = np.array([[float(part[0]) for part in motion(time)] for time in t]).T
    noise = 2e-4 * np.random.default_rng(seed).standard_normal(len(t))
    numbers = tuple(STRIBECK.values())
    x, u = stribeck_joint(inertia, 9.81 * 0.2, numbers, r, dr, noise, 2.0 * np.pi / 8192).T
    return {"t": t, "x": x, "u": u}


def found_of(name: str, seed: int) -> tuple[Any, dict[str, float]]:
    """Return what is found of a machine, and what is true."""
    if name == "stribeck":
        arm = smc.plant_from(chain([0.4], [1.0]), ["j1"], name="stribeck_arm")
        start = smc.hardware.ServoFriction(kc=0.1, kcs=0.05, vs=0.3, kv=0.1, alpha=2.0)
        machine = smc.Scenario(plant=arm, friction=start, law="none")
        inertia = float(arm.load().dof_M0[0])
        motions = [
            sines([0.0], [0.5, 0.3, 0.15], [0.23, 0.7, 1.9]),
            sines([0.0], [0.4, 0.3, 0.1], [0.31, 0.9, 2.3]),
        ]
        run, held = (
            stribeck_log(seed + 50 * k, joint_motion, inertia)
            for k, joint_motion in enumerate(motions)
        )
        return smc.identify(machine, run, list(STRIBECK), held_out=held), STRIBECK
    m = MACHINES[name]
    measured = m.get("measured", [])
    fields = {"joints": m["joints"], "measured": measured} | m["log"]
    kp, kd = fields.pop("kp"), fields.pop("kd")
    run, held = (
        log(m["xml"], m["truth"], motion, kp, kd, seed=100 * seed + k, **fields)
        for k, motion in enumerate((m["motion"], m["other"]))
    )
    machine = smc.plant_from(m["xml"], m["joints"], measured=measured or None)
    return smc.identify(machine, run, list(m["truth"]), held_out=held), m["truth"]


def known(names: list[str], seeds: int) -> None:
    """Print what is found of machines whose numbers are known."""
    inside = total = 0
    for name in names:
        for seed in range(seeds):
            begin = time.process_time()
            identified, truth = found_of(name, seed)
            spent = time.process_time() - begin
            print(f"{name}, seed {seed}: {spent:.0f} s of processor, {identified.evaluations} sets")
            for path, true in truth.items():
                off = identified.values[path] - true
                error = identified.errors[path]
                within = abs(off) <= max(2.0 * error, 0.003 * abs(true))
                inside += within
                total += 1
                start = identified.before.values[path] / true - 1.0
                print(
                    f"  {path:20s} {true:8.4g}  start {100 * start:+6.1f} %"
                    f"  off {100 * off / true:+6.2f} %, {off / error:+5.1f} errors"
                    f"{'' if within else '  outside'}"
                )
            worst = min(identified.by_pieces[0].values())
            print(f"  fits {worst:.2f} % in pieces of 1 s", flush=True)
    print(f"{inside} of {total} numbers within two errors or 0.3 %")


def public(folder: Path) -> None:
    """Print what is found of the AK80-6 pendulum, and its fit on records that were not used."""

    arm = smc.plant_from(pendulum(), ["j"], name="ak80")
    names = ["m", "j.armature", "j.damping", "j.frictionloss", "j.offset", "input_delay"]
    used = tuple(pendulum_log(folder, name) for name in ("ddp", "direct_collocation"))
    names_of_others = "energy_shaping", "pd-system_identification"
    held_out = {name: pendulum_log(folder, name) for name in names_of_others}
    beside_published(arm, names, used, held_out)
    arm = smc.plant_from(double_pendulum(), ["shoulder", "elbow"])
    names = [f"{joint}.{kind}" for joint in ("shoulder", "elbow") for kind in KINDS]
    used = tuple(double_pendulum_log(folder, name, 6.0) for name in ("03", "13"))
    held_out = {name: double_pendulum_log(folder, name, 8.0) for name in ("01", "05", "07")}
    beside_published(arm, [*names, "input_delay"], used, held_out)


def beside_published(arm: Any, names: list[str], used: tuple, others: dict[str, dict]) -> None:
    """Print what logs give, and how it fits others, beside the published numbers of the model."""
    begin = time.process_time()
    identified = smc.identify(arm, list(used), names)
    print(f"{time.process_time() - begin:.0f} s of processor\n{identified}")
    before = own_rig(arm, [name for name in names if name.endswith(".frictionloss")])
    for name, record in others.items():
        ours, theirs = (held_out_fit(rig, record).by_pieces for rig in (identified.rig, before))
        for column, fit in ours.items():
            published = f"published numbers {theirs[column]:.2f} %"
            print(f"held out {name}, {column} in pieces of 1 s: {fit:.2f} %, {published}")


if __name__ == "__main__":
    warnings.simplefilter("ignore", smc.errors.ScenarioWarning)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("machines", nargs="*", default=[*MACHINES, "stribeck"])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--public", type=Path)
    options = parser.parse_args()
    if options.public:
        public(options.public)
    else:
        known(options.machines, options.seeds)
