"""Wild values and scenarios, each made of one random.Random: what the fuzz and the long attack
throw.
"""

import datetime
import decimal
import fractions
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

import smc_mujoco as smc
from smc_mujoco.common.errors import shown
from smc_mujoco.mechanisms.plant import Plant
from smc_mujoco.simulation.conditions import NAMED, find_condition

ARM = """<mujoco><worldbody><body><joint name="shoulder" axis="0 1 0" damping="0.1"/>
<geom type="capsule" size="0.05" fromto="0 0 0 0.5 0 0" mass="1"/>
<body pos="0.5 0 0"><joint name="elbow" axis="0 1 0"/>
<geom type="capsule" size="0.04" fromto="0 0 0 0.4 0 0" mass="0.5"/></body></body></worldbody>
<actuator><motor joint="shoulder" ctrlrange="-3 3"/></actuator></mujoco>"""


class Shy:
    """A value whose repr raises."""

    def __repr__(self):
        raise KeyError("no")


class Awkward:
    """A value on which everything raises."""

    def __getattr__(self, name):
        raise ZeroDivisionError("awkward")

    __eq__ = __hash__ = __iter__ = __len__ = __bool__ = __float__ = __fspath__ = __getattr__  # type: ignore


def nested(depth: int) -> list:
    """A list in a list in a list ..."""
    value: list = []
    for _ in range(depth):
        value = [value]
    return value


NUMBERS = [
    math.nan,
    math.inf,
    -math.inf,
    0.0,
    -0.0,
    5e-324,
    1e-320,
    1e-300,
    1e-16,
    1e16,
    1e200,
    -1e200,
    1e306,
    1e308,
]
NUMBERS += [
    -1e308,
    0,
    1,
    -1,
    2**31,
    2**53,
    2**63,
    2**64,
    10**400,
    -(10**400),
    10**5000,
    0.1,
    0.5,
    3,
    True,
    False,
]
NUMBERS += [
    np.float32(0.1),
    np.float16(np.inf),
    np.int64(3),
    np.uint8(255),
    np.longdouble("1e4000"),
    np.bool_(True),
]
NUMBERS += [
    fractions.Fraction(1, 3),
    fractions.Fraction(10**400),
    decimal.Decimal("0.1"),
    1j,
    np.complex128(1.0),
]
NUMBERS += [
    np.timedelta64(1, "s"),
    np.timedelta64("NaT", "s"),
    np.datetime64("2026-01-01"),
    datetime.timedelta(1),
]
TEXTS = [
    "",
    " ",
    "0",
    "1",
    "nan",
    "duffing",
    "classical",
    "x",
    "\0",
    "a\0b",
    "\ud800",
    "a\n b",
    "../../x",
    "/",
    ".",
]
TEXTS += [
    "~",
    "é" * 300,
    "x" * 100_000,
    "\x1b[31m",
    "con",
    "a.npz",
    "%s{0}",
    "$x_1^",
    b"1",
    b"",
    b"a\0",
    bytearray(b"1"),
]
ARRAYS = [
    np.array(0.5),
    np.array([0.5]),
    np.zeros(0),
    np.zeros(2),
    np.zeros((2, 2)),
    np.array(["a"]),
    np.array(None),
]
ARRAYS += [
    np.array([None, 1], object),
    np.array([math.nan]),
    np.zeros(3, bool),
    np.ma.masked,
    np.zeros(1, "f4,i4"),
]
SEVERAL = [
    (),
    [],
    {},
    set(),
    frozenset(),
    [1.0],
    (1.0, 2.0),
    [math.nan],
    ["a"],
    [None],
    {"a": 1},
    {1: 2},
    {"a": None},
]
SEVERAL += [
    range(3),
    range(10**9),
    [[]],
    [[1]],
    {"M": 1.3},
    {"mass": math.nan},
    {1.0},
    nested(3),
    nested(1000),
]
SEVERAL += [
    nested(50_000),
    [Shy()],
    {Shy: Shy()},
    [1, "a"],
    [[1, 2], [3]],
    [1.0] * 1000,
    {"x": {}},
    [True, False],
]
OTHERS = [
    None,
    ...,
    NotImplemented,
    int,
    float,
    str,
    object,
    object(),
    Shy(),
    Awkward(),
    Shy,
    print,
    len,
    math,
    smc,
]
OTHERS += [
    lambda: 1,
    lambda *a, **k: None,
    lambda x: x,
    Path("a"),
    Path("a.npz"),
    ValueError("x"),
    type,
    slice(1),
]
MADE: list[Callable[[], Any]] = [  # made again for each use
    lambda: iter([]),
    lambda: iter([1.0, 2.0]),
    lambda: (x for x in ("a", "b")),
    lambda: zip([1], [2], strict=True),
    lambda: smc.Constant(1.0),
    lambda: smc.Noise(0.1),
    lambda: smc.law("none"),
    lambda: smc.law("classical"),
    lambda: smc.surface("linear"),
    lambda: smc.estimator("measured"),
    lambda: smc.plant("duffing"),
    lambda: smc.Jump(0.0, {}),
    smc.Encoder,
    lambda: smc.Coulomb(0.1),
    lambda: smc.Lag(0.1),
    lambda: smc.hardware.Contact("none"),
    lambda: smc.Scenario(plant="duffing", law=smc.law("classical"), duration=0.01),
]
FIXED = [NUMBERS, TEXTS, ARRAYS, SEVERAL, OTHERS]


def value(random: Random) -> Any:
    """Any value that somebody may give."""
    kind = random.randrange(len(FIXED) + 1)
    if kind == len(FIXED):
        return random.choice(MADE)()
    return random.choice(FIXED[kind])


def wide(random: Random) -> float:
    """A number, often a plain one."""
    match random.randrange(5):
        case 0 | 1 | 2:
            return random.uniform(-10.0, 10.0)
        case 3:
            return random.choice(
                [0.0, 1e-300, 1e-9, 1e9, 1e99, 1e154, 1e155, 1e300, -1e300, 1.7e308]
            )
        case _:
            return random.choice([-1, 1]) * 10.0 ** random.uniform(-308, 308)


def positive(random: Random) -> float:
    """A number from 0 on, often below 1."""
    if random.random() < 1 / 3:
        return abs(wide(random))
    return random.uniform(1e-3, 1.0)


def few(random: Random, items: Sequence, most: int) -> list:
    """None or some of the items."""
    return random.sample(items, random.randint(0, min(most, len(items))))


def changed(
    random: Random, kind: type, required: Sequence[str], optional: Sequence[str] = ()
) -> Any:
    """An instance with wild numbers; those of `optional` now and then."""
    names = [*required, *few(random, optional, 3)]
    return kind(**{name: random.choice([positive, positive, wide])(random) for name in names})


def smooth(random: Random) -> smc.Signal:
    """A signal without noise."""
    times = random.choice([lambda: random.uniform(0.0, 0.03), lambda: wide(random)])
    sample_times = sorted({times() for _ in range(random.randint(2, 9))})
    return random.choice(
        [
            lambda: smc.Constant(wide(random)),
            lambda: smc.Sine(wide(random), wide(random), wide(random)),
            lambda: smc.Step(wide(random), times()),
            lambda: smc.signals.Pulse(wide(random), times(), positive(random)),
            lambda: smc.signals.Impulse(wide(random), times(), positive(random)),
            lambda: smc.signals.Ramp(wide(random), times()),
            lambda: smc.signals.MinimumJerk(wide(random), times(), positive(random)),
            lambda: smc.signals.TimeSeries(sample_times, [wide(random) for _ in sample_times]),
        ]
    )()


def signal(random: Random) -> smc.Signal:
    """Any signal of the package."""
    match random.randrange(6):
        case 0:
            return smc.signals.Gust(wide(random), random.uniform(0.0, 0.03), positive(random))
        case 1:
            return smc.signals.BandLimited(
                positive(random), random.uniform(0.0, 1.0), 1.0 + 100.0 * positive(random)
            )
        case 2:
            return smc.signals.OrnsteinUhlenbeck(
                positive(random), positive(random), random.choice([1e-3, positive(random)])
            )
        case _:
            return smooth(random)


def plant(random: Random) -> Plant:
    """A plant, of networks 2 to 4 channels, some parameters wild; now and then a user's own."""
    if random.random() < 0.1:
        Path("arm.xml").write_text(ARM)
        channels = random.choice(
            [["shoulder"], ["shoulder", "elbow"], {"shoulder": smc.Channel(partner="elbow")}]
        )
        return smc.plant_from("arm.xml", channels)
    name = random.choice(smc.plants())
    plain = smc.plant(name)
    least, most = plain.sizes
    parameters: dict[str, float]
    if most == 1:
        parameters = {}
    else:
        parameters = {"n": random.randint(least, min(most, max(least, 4)))}
    for key in few(random, sorted(plain.parameters), 2):
        if key in plain.positive:
            parameters[key] = positive(random)
        else:
            parameters[key] = wide(random)
    return smc.plant(name, **parameters)


def component(random: Random, find: Callable[..., Any], names: Sequence[str]) -> Any:
    """A law, surface or estimator, some gains wild."""
    name = random.choice(names)
    keys = few(random, sorted(find(name).gains), 3)
    return find(
        name, **{key: positive(random) if key in ("lam", "phi") else wide(random) for key in keys}
    )


@smc.law_function(gains={"k": 2.0})
def raising(y, gains, memory):
    """A law that raises now and then."""
    memory[0] += 1.0
    return gains.k / (4.0 - memory[0]), y.e


@smc.law_function
def odd(y, gains, memory):
    """A law that returns what is no number."""
    return math.nan if y.t > 0.004 else -y.e, math.inf


@smc.law_function
def plain(y, gains, memory):
    """A law that does not compile."""
    return float(str(-y.e)), y.e


def law(random: Random) -> Any:
    """A law of the library, or one of the test's own."""
    if random.random() < 0.05:
        return random.choice([raising, odd, plain])
    return component(random, smc.law, smc.laws())


def factors(random: Random, plant: Any) -> dict[str, float]:
    """Factors on parameters that the plant has, now and then on one that it lacks."""
    if isinstance(plant, Plant) and random.random() < 0.98:
        parameter_names = [*plant.parameters, "mass"]
    else:
        parameter_names = ["mass", "no"]
    return {
        key: random.choice([random.uniform(0.1, 10.0), positive(random)])
        for key in few(random, parameter_names, 2)
    }


def friction(random: Random) -> list:
    """Frictions, at times two of a kind."""
    kinds = [
        lambda: smc.Viscous(positive(random)),
        lambda: smc.Coulomb(positive(random)),
        lambda: changed(
            random, smc.hardware.LuGre, ["coulomb", "static", "stribeck"], ["stiffness", "damping"]
        ),
        lambda: changed(random, smc.hardware.Sigmoid, ["p1", "p2"], ["hold", "stiffness"]),
        lambda: random.choice(
            [smc.hardware.servo("mx106", "m6").friction, smc.hardware.servo("mx64", "m1").friction]
        ),
    ]
    return [random.choice(kinds)() for _ in range(random.randint(0, 2))]


def actuator(random: Random) -> list:
    """What stands between command and joint."""
    motor = [
        "resistance",
        "inductance",
        "torque_constant",
        "gear",
        "rotor_inertia",
        "cogging",
        "poles",
        "voltage",
    ]
    kinds = [
        lambda: smc.Lag(positive(random)),
        lambda: smc.hardware.RateLimit(positive(random)),
        lambda: changed(random, smc.DCMotor, [], motor),
        lambda: changed(random, smc.Backlash, ["gap"], ["rotor_inertia", "rotor_damping"]),
        lambda: changed(
            random, smc.hardware.ElasticJoint, ["stiffness"], ["damping", "rotor_inertia"]
        ),
        lambda: changed(
            random, smc.hardware.Stepper, [], ["teeth", "torque", "gear", "ramp", "queue", "refill"]
        ),
    ]
    return [random.choice(kinds)() for _ in range(random.randint(0, 2))]


def fields(random: Random) -> dict[str, Any]:
    """The arguments of a Scenario; one in forty is not sane."""
    step = random.choice([1e-3, 5e-4, 2e-3, 1e-4, 1 / 3000, 0.01])
    held = random.randint(1, 4)
    if random.random() < 1 / 40:
        where = value(random)
    else:
        where = plant(random)
    n = where.n if isinstance(where, Plant) else 1
    if isinstance(where, Plant):
        offered = [*where.contacts, "none"]
    else:
        offered = ["none"]
    if isinstance(where, Plant):
        builds = [*where.mechanisms, "equation"]
    else:
        builds = ["equation"]

    def state() -> Any:
        return random.choice([None, random.uniform(-3, 3), [wide(random) for _ in range(n)]])

    sane: dict[str, Callable[[], Any]] = {
        "control_period": lambda: held * step,
        "physics_step": lambda: random.choice([None, step]),
        "u_max": lambda: random.choice(
            [random.uniform(0.1, 100.0), math.inf, 1e-300, 1e10, 2e10, 1e308]
        ),
        "x0": state,
        "v0": state,
        "reference": lambda: smooth(random),
        "disturbance": lambda: random.choice(
            [None, signal(random), [signal(random) for _ in range(2)]]
        ),
        "noise": lambda: random.choice([None, smc.Noise(positive(random), positive(random))]),
        "input_delay": lambda: random.randint(0, 6) * step,
        "velocity": lambda: component(random, smc.estimator, smc.laws(kind="estimator")),
        "surface": lambda: random.choice(
            [None, component(random, smc.surface, smc.laws(kind="surface"))]
        ),
        "model": lambda: random.choice([None, "none", "nominal"]),
        "mismatch": lambda: factors(random, where),
        "jump": lambda: smc.Jump(random.uniform(0.0, 0.03), factors(random, where)),
        "seed": lambda: random.randrange(2**53),
        "integrator": lambda: random.choice([None, "RK4", "Euler", "implicitfast", "implicit"]),
        "friction": lambda: friction(random),
        "actuator": lambda: actuator(random),
        "sensor": lambda: changed(
            random, smc.Encoder, [], ["counts", "bias", "dropout", "period", "delay"]
        ),
        "contact": lambda: random.choice(offered),
        "mechanism": lambda: random.choice(builds),
    }
    names = {*few(random, sorted(sane), random.choice([2, 5, len(sane)])), "law", "duration"}
    sane |= {"law": lambda: law(random), "duration": lambda: random.uniform(1e-3, 0.03)}
    scenario_fields = {}
    for name in sorted(names):
        if random.random() < 1 / 40:
            scenario_fields[name] = value(random)
        else:
            scenario_fields[name] = sane[name]()
    if random.random() < 1 / 200:
        scenario_fields[random.choice(["sed", "lawn", "x_0", "", "controlperiod"])] = value(random)
    return {"plant": where} | scenario_fields


def starts(random: Random, n: int) -> Any:
    """Where the runs of a grid begin: nothing said, or wild numbers."""
    if random.random() < 0.5:
        return None
    x0 = random.choice([None, random.uniform(-3, 3), [wide(random) for _ in range(n)]])
    arguments = {"x0": x0} | {name: positive(random) for name in few(random, ["spread", "by"], 2)}
    if random.random() < 1 / 40:
        arguments[random.choice(["x0", "spread", "by", "bye"])] = value(random)
    return smc.starts(**arguments)


def gridded(random: Random, fields: dict[str, Any]) -> list[smc.Scenario]:
    """The fields as a user's condition, by itself, with one of the suite's or as text, on a grid of
    two seeds.
    """
    condition_fields = {}
    for name, held in fields.items():
        if name not in ("plant", "law", "duration", "model", "surface"):
            condition_fields[name] = held
    seeds = [0, condition_fields.pop("seed", 7)]
    ours = random.choice(sorted(NAMED))
    if condition_fields:
        mine = smc.condition("wild", **condition_fields)
    else:
        mine = find_condition(ours)
    around = starts(random, fields["plant"].n if isinstance(fields["plant"], Plant) else 1)
    way = random.randrange(3)
    if way == 0 and condition_fields:
        condition = mine + find_condition(ours)
    else:
        condition = mine

    def grid(of: Any) -> list[smc.Scenario]:
        return smc.grid(
            [fields["plant"]],
            [fields["law"]],
            of,
            seeds,
            gains="default",
            duration=fields["duration"],
            starts=around,
        )

    scenarios = grid(condition)
    if way == 1 and (read := _read(str(mine))) is not None and grid(read) != scenarios:
        raise AssertionError(f"{shown(str(mine))} is read as another condition")
    return scenarios


def _read(text: str) -> Any:
    """The condition that a text tells, None where it is refused: its values may be wild."""
    try:
        return find_condition(text)
    except smc.ScenarioError:
        return None
