"""How far runs of twelve machines are off at the default integrator and step, and what they cost,
beside implicitfast at 0.25 ms.

    python benchmarks/integrators.py [--write]

The truth is RK4 at a sixteenth of the default step (at most 1/256 ms where poles need it). The
table of docs/accuracy.md is that of benchmarks/integrators.json, which --write writes. The machines
are written here, with numbers drawn at random.
"""

import dataclasses
import json
import random
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import smc_mujoco as smc
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.trace import Trace

MEASURED = Path(__file__).with_suffix(".json")
LAWS = "pid", "super_twisting"
SCORES = "ultimate_bound", "rms_error"
TIMES = 3  # each run is timed, the shortest counts
DURATION = 4.0  # s
LEAST = 0.001  # %, that the table writes
SHORTEST = 1e-3 / 256  # s, of the truth
HEAD = """<mujoco model="{}"><compiler angle="radian"/><option cone="elliptic"/>
<default><geom type="capsule" size=".02"/></default><worldbody>"""
FREE = 'contype="0" conaffinity="0"'
SINE = smc.Sine(0.3, 3.0)

Machine = tuple[Plant, dict]


def chain(n: int, damping: float = 0.0, armature: float = 0.0) -> str:
    """The MJCF of a chain of n links with random numbers, and more damping and armature."""
    rng = random.Random(f"chain {n}")
    text = HEAD.format(f"chain{n}")
    place = 1.5
    for i in range(1, n + 1):
        length, mass = rng.uniform(0.25, 0.45), rng.uniform(0.4, 1.4) / i
        text += (
            f'<body name="b{i}" pos="0 0 {place}"><joint name="j{i}" axis="0 1 0" '
            f'damping="{damping + rng.uniform(0.01, 0.06):.4f}" '
            f'armature="{armature + rng.uniform(0, 0.02):.4f}" '
            f'range="-6 6"/><geom name="g{i}" fromto="0 0 -.03 0 0 {0.03 - length:.4f}" '
            f'mass="{mass:.4f}" {FREE}/>'
        )
        place = -round(length, 4)
    motors = (f'<motor joint="j{i}" ctrlrange="-40 40"/>' for i in range(1, n + 1))
    return f"{text}{'</body>' * n}</worldbody><actuator>{''.join(motors)}</actuator></mujoco>"


def own(text: str, joints: dict[str, float], name: str, **more) -> Plant:
    """The plant of a text, with the starts of its channels."""
    channels = {joint: smc.Channel(x0=x0, motor=True) for joint, x0 in joints.items()}
    return smc.plant_from(text, channels, name=name, **more)


def of_chain(n: int) -> Machine:
    """A chain with ranges that are never reached."""
    return own(chain(n), {f"j{i}": 0.2 for i in range(1, n + 1)}, f"chain{n}"), {"reference": SINE}


def industrial() -> Machine:
    """A heavy arm of six joints with strong damping and armatures, four held by servos."""
    text = chain(6, damping=60.0, armature=0.1)
    for i in range(3, 7):
        servo = f'<position joint="j{i}" kp="2000" kv="100" ctrlrange="-3 3"/>'
        text = text.replace(f'<motor joint="j{i}" ctrlrange="-40 40"/>', servo)
    return own(text, {"j1": 0.1, "j2": 0.1}, "industrial", others="file"), {"reference": SINE}


def servos() -> Machine:
    """A chain of four joints, two of them held by stiff light servos."""
    text = chain(4)
    for i in (3, 4):
        servo = f'<position joint="j{i}" kp="300" kv="6" ctrlrange="-3 3"/>'
        text = text.replace(f'<motor joint="j{i}" ctrlrange="-40 40"/>', servo)
    return own(text, {"j1": 0.1, "j2": 0.1}, "servos", others="file"), {"reference": SINE}


def finger() -> Machine:
    """A hand's finger of 32 g, with strong damping."""
    links = "".join(
        f'<body pos="0 0 {z}"><joint name="j{i}" axis="0 1 0" damping=".02" range="-1.6 1.6"/>'
        f'<geom size=".006" fromto="0 0 0 0 0 {length}" mass="{mass}" {FREE}/>'
        for i, (z, length, mass) in enumerate(((0.3, 0.04, 0.02), (0.04, 0.03, 0.012)), 1)
    )
    motors = '<motor joint="j1" ctrlrange="-.3 .3"/><motor joint="j2" ctrlrange="-.2 .2"/>'
    end = f"</body></body></worldbody><actuator>{motors}</actuator></mujoco>"
    return own(HEAD.format("finger") + links + end, {"j1": 0.2, "j2": 0.2}, "finger"), {
        "reference": SINE
    }


def cart() -> Machine:
    """A hanging cart-pole on a rail with ends."""
    text = (
        f'{HEAD.format("cart")}<body name="cart" pos="0 0 1"><joint name="slide" type="slide" '
        f'axis="1 0 0" range="-1.8 1.8" damping=".1"/><geom type="box" size=".1 .05 .05" '
        f'mass="1" {FREE}/><body><joint name="hinge" axis="0 1 0" damping=".002" range="-6.2 6.2"/>'
        f'<geom fromto="0 0 0 0 0 -.6" mass=".2" {FREE}/></body></body></worldbody>'
        '<actuator><motor joint="slide" ctrlrange="-20 20"/></actuator></mujoco>'
    )
    return own(text, {"slide": 0.3}, "cart", measured=["hinge"]), {"reference": SINE}


def quadruped() -> Machine:
    """A body on four legs of two joints, which stands on its floor; one leg is commanded."""
    text = HEAD.format("quadruped") + '<geom name="floor" type="plane" size="9 9 1"/>'
    text += '<body pos="0 0 .383"><freejoint/><geom type="box" size=".2 .1 .05" mass="6"/>'
    motors = ""
    for x in (1, -1):
        for y in (1, -1):
            leg = f"{'fr'[x < 0]}{'lr'[y < 0]}"
            text += (
                f'<body pos="{0.18 * x} {0.14 * y} 0"><joint name="{leg}hip" axis="0 1 0" '
                f'range="-1 1" damping=".5" armature=".01"/><geom {FREE} fromto="0 0 0 0 0 -.2" '
                f'mass=".5"/><body pos="0 0 -.2"><joint name="{leg}knee" axis="0 1 0" '
                f'range="-2 2" damping=".5" armature=".01"/><geom {FREE} fromto="0 0 0 0 0 -.16" '
                f'mass=".2"/><geom type="sphere" size=".022" pos="0 0 -.16" mass=".05"/>'
                "</body></body>"
            )
            motors += "".join(
                f'<position joint="{leg}{joint}" kp="80" kv="2" ctrlrange="-2 2"/>'
                for joint in ("hip", "knee")
            )
    text += f"</body></worldbody><actuator>{motors}</actuator></mujoco>"
    plant = own(text, {"flhip": 0.0, "flknee": 0.0}, "quadruped", others="file")
    return plant, {"reference": smc.Sine(0.1, 3.0), "u_max": 20.0}


def wall() -> Machine:
    """A chain of two joints that leans on a Wall."""
    blow = smc.Wall("b2", direction=(1, 0, 0), gap=0.15, restitution=0.3)
    plant = own(chain(2), {"j1": 0.0, "j2": 0.0}, "wall")
    return plant, {"reference": smc.Constant(-0.6), "contact": blow}


def ball() -> Machine:
    """A paddle with a ball that falls on it."""
    text = (
        f'{HEAD.format("ball")}<geom name="floor" type="plane" size="3 3 .1"/>'
        '<body name="paddle" pos="0 0 .6"><joint name="j1" axis="0 1 0" range="-1 1" '
        'damping=".05" armature=".01"/><geom type="box" pos=".2 0 0" size=".2 .1 .01" mass=".5"/>'
        '</body><body name="ball" pos=".3 0 .8"><freejoint/><geom type="sphere" size=".04" '
        'mass=".1"/></body></worldbody><actuator><motor joint="j1" ctrlrange="-10 10"/></actuator>'
        "</mujoco>"
    )
    return own(text, {"j1": 0.1}, "ball"), {"reference": SINE}


MACHINES: dict[str, Callable[[], Machine]] = {
    **{f"chain of {n}, ranges": lambda n=n: of_chain(n) for n in (1, 2, 3, 4)},
    "six joints, strong damping": industrial,
    "arm with servos": servos,
    "finger of 32 g": finger,
    "cart-pole on a rail": cart,
    "standing quadruped": quadruped,
    "chain at a wall": wall,
    "ball on a paddle": ball,
    "chain of 3, dry friction": lambda: (
        own(chain(3), {f"j{i}": 0.2 for i in (1, 2, 3)}, "rubs"),
        {"reference": SINE, "friction": smc.Coulomb(0.3)},
    ),
}


def timed(scenario: smc.Scenario) -> tuple[Trace, float]:
    """A run and its shortest processor time, s."""
    spent = []
    for _ in range(TIMES):
        start = time.process_time()
        trace = smc.run(scenario, threads=1)
        spent.append(time.process_time() - start)
    return trace, min(spent)  # pyright: ignore[reportPossiblyUnboundVariable]


def row(scenario: smc.Scenario) -> dict:
    """What the default costs and how far it is off, in percent."""
    resolved = scenario.resolved
    before, first = timed(
        dataclasses.replace(scenario, integrator="implicitfast", physics_step=2.5e-4)
    )
    now, spent = timed(scenario)
    step = resolved.physics_step / 16 if resolved.integrator == "RK4" else SHORTEST
    truth = smc.run(dataclasses.replace(scenario, integrator="RK4", physics_step=step))
    values: dict = {
        "integrator": resolved.integrator,
        "ms": 1e3 * resolved.physics_step,
        "cost": spent / first,
        "marked": bool(now.unresolved),
    }
    for name, trace in (("before", before), ("now", now)):
        for score in SCORES:
            true = smc.score(truth)[score]
            values[f"{name} {score}"] = 100.0 * (smc.score(trace)[score] / true - 1.0)
    return values


def measure() -> dict[str, dict]:
    """The rows of all machines under both laws."""
    rows = {}
    for name, make in MACHINES.items():
        plant, fields = make()
        for law in LAWS:
            scenario = smc.Scenario(plant=plant, law=law, duration=DURATION, model="none", **fields)
            rows[f"{name} | {law}"] = row(scenario)
            print(name, law, rows[f"{name} | {law}"], flush=True)
    return rows


def percent(value: float) -> str:
    """An error in the table."""
    return f"{abs(value):.2g} %" if abs(value) >= LEAST else f"below {LEAST:g} %"


def table(rows: dict[str, dict]) -> str:
    """The table of docs/accuracy.md: errors of the ultimate bound and of rms, in percent."""
    lines = [
        "| machine | law | default | bound, rms off | told | under implicitfast, 0.25 ms | time |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, values in rows.items():
        errors = {}
        for when in ("now", "before"):
            errors[when] = ", ".join(percent(values[f"{when} {score}"]) for score in SCORES)
        lines.append(
            f"| {name} | {values['integrator']}, {values['ms']:g} ms | {errors['now']} | "
            f"{'yes' if values['marked'] else 'no'} | {errors['before']} | {values['cost']:.2f} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    measured = measure()
    print(table(measured))
    if "--write" in sys.argv:
        MEASURED.write_text(json.dumps(measured, indent=1) + "\n", encoding="utf-8")
