"""Laws of many joints in C: written out, they give the compiled law's bits; every mistake is one
sentence.
"""

import math
import re
import subprocess
from typing import NamedTuple

import numpy as np
import pytest
from exchange.helpers.compiler import needs_compiler
from helpers import arms, reference
from helpers.runs import assert_same
from helpers.sources import strange
from numba import njit

import smc_mujoco as smc
from smc_mujoco.control.joint_law import (
    JointMeasurement,
    coriolis,
    norm,
    product,
    saturate,
    solve,
    torque,
)
from smc_mujoco.control.units import Gain
from smc_mujoco.exchange.c import build
from smc_mujoco.simulation import python_functions
from smc_mujoco.simulation.python_functions import gains_of

pytestmark = needs_compiler

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wmissing-prototypes")
LAWS = arms.LAWS
TYPE = (
    "int smc_law(const smc_measurement *y, const smc_real *gains, smc_real *memory, smc_real *out)"
)
EACH = np.array([1.0, 0.25, 3.0])
ORDER = np.array([2, 0, 1])


@njit
def ends(a, part):
    return np.minimum(a, 0.0) * part, np.maximum(a, 0.0)


@njit
def scaled(a):
    return a[0] * a


@njit
def inside(a, b):
    if a[0] > 0.0:
        return b
    return a * b


@njit
def neighbours(a, order):
    w = np.zeros(len(a))
    signs = np.array([1, -1, 2])
    for i in range(len(a)):  # the first reads the last element, as a[-1]
        w[i] = a[order[i]] - signs[order[i] - 1] * a[i - 1]
    return w


@smc.law_function(
    joint=True,
    gains={
        "k": 20.0,
        "c": 5.0,
        "all": Gain(0.5, shared=True),
    },
    memory=3,
)
def turns(y, gains, memory):
    """Every turn of Python with arrays that there is."""
    n = len(y.x)
    s = y.de + gains.c * y.e
    twice = np.zeros(n)
    s = s + 0.1 * product(y.M, s)
    s = s - s[0] * y.e  # reads an element that it changes
    s = s + 0.01 * neighbours(s, ORDER)
    square = np.zeros((n, n))
    square[:, :] = y.M
    turned = y.e.copy()
    turned = scaled(product(square, turned))
    turned = scaled(turned)
    s = s + 0.01 * turned
    twice += 2 * s
    twice[0] = twice[n - 1] ** 2 + s[1]
    memory[:, 0] += y.dt * saturate(s)
    memory[:, 1] = memory[:, 0] - memory[:, 1] * 0.5
    for i in range(n):
        if s[i] > 0.0:
            memory[i, 2] = memory[i, 1]
        else:
            memory[i, 2] = math.tanh(y.a[i] / y.limit[i])
    table = np.ones((2, n))
    column = np.empty((n, n))
    table[1] = s * EACH
    column[:, 0] = table[1]
    for i in range(1, n):
        column[:, i] = y.M[i] - column[:, i - 1]
    low, high = ends(column[:, n - 1], gains.all)
    total = 0.0
    for i in range(n):
        total += twice[i]
    if norm(y.e) > 0.1 and total < 1e3:
        u = (
            np.where(s > low, np.sqrt(np.abs(s)) * np.sign(s), np.minimum(s, high))
            - s**2
            - 0.1 * np.abs(s) ** 0.5
        )
    else:
        u = torque(y, -gains.k * s) - coriolis(y, np.array([s[0], 0.5, total / (1.0 + abs(total))]))
    bent = u.copy()
    bent[1] -= inside(bent, y.g)[2]
    u = (
        bent
        + gains.k * (memory[:, 2] - low)
        + table[0] * (twice - gains.all * np.ones(n))
        + solve(y.M, y.h)
    )
    return 0.01 * u, s


class Pair(NamedTuple):
    first: float
    second: float


@njit
def turned(q, k):
    w, a, b = q
    return a * k, b, w


@njit
def next_of(q):
    if q[0] > 0.0:
        return turned(q, 2.0)
    return (q[1], 0.25, q[-1])


@njit
def filtered(x, i, states):
    before = states[i]
    states[i] = 0.5 * (before + x)
    return before


@njit
def shift(states, pair):
    rest = states[1:]
    rest[0] += pair.first - 0.5 * states[0]
    states[0] = pair.second


@njit
def split(a):
    return a[1:], (a[0], a[2]), a[0] * a[:2]


@njit
def swapped(a, b):
    return b[0], a[0]


@njit
def sum_and_difference(a, b):
    return a + b, a - b


@smc.law_function(joint=True, gains={"k": 20.0, "c": 5.0}, memory=5)
def parts(y, gains, memory):
    """Every turn of Python with parts of arrays and tuples that there is."""
    n = len(y.x)
    s = y.de + gains.c * y.e
    u = np.zeros(n)
    slot = memory[:, 0]
    table = np.zeros((3, n))
    q = s[0], 0.5, -s[2]
    q = q[1], q[2], q[0] + len(q)
    if y.t > 0.05:
        q = next_of(q)
    else:
        q = next_of((s[1], q[0], q[2]))
    tail, pair, two = split(s)
    tail, two = sum_and_difference(tail, two)
    u[:2], u[2] = two, pair[1] + q[n - 2]
    u[0], u[1] = swapped(u, tail)  # the second result is of the u before
    u[1:] += tail
    u[1:] = u[:2]  # reads what it changes
    for i in range(n):
        row = memory[i, 2:]
        shift(row, Pair(s[i], u[i]))
        u[i] += filtered(s[i], i, memory[:, 1])
        u[i] += 1e-2 * (row[0] - row[-1]) * pair[i % 2]
    slot[:] = 0.5 * slot + u
    slot[0], u[1] = 0.5 * slot[0], memory[0, 0]  # of before
    memory[1:, 0] = memory[:2, 0] + slot[1:]
    bottom = table[1:]
    bottom[0] = s
    bottom[1, 1:] = table[1, :-1]
    shift(table[2], Pair(slot[1], q[0]))
    for i in range(len(q)):
        u[-1] += 1e-2 * q[i]
    return u + 0.1 * table[1] - gains.k * table[2], slot


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("joint_laws")


@pytest.fixture(scope="module")
def compiled(folder):
    """Name -> a law, and what its C for three joints is as a law, compiled without a warning."""
    laws = {name: template() for name, template in LAWS.items()} | {
        "with gains by joint": smc.law("passivity_based", K=[1.0, 2.0, 0.5], k=[0.3, 0.0, 0.1]),
        "turns": turns(k=[10.0, 20.0, 30.0]),
        "parts": parts(),
    }

    def make(name: str):
        (path := folder / f"{name}.c").write_text(smc.exchange.law_to_c(laws[name], joints=3))
        return smc.exchange.law_from_c(path, flags=STRICT, timeout=60.0, name=f"c {name}")

    return {
        name: (laws[name], law_from_c())
        for name, law_from_c in zip(laws, map(make, laws), strict=True)
    }


def scenario(law, plant=None, **fields) -> smc.Scenario:
    common = {
        "duration": 0.1,
        "reference": smc.Sine(0.2, 5.0),
        "noise": smc.Noise(1e-3, 1e-2),
        "u_max": 50.0,
    }
    return smc.Scenario(plant=plant or arms.arm(), law=law, **common | fields)


WAYS = {
    "arm": {"x0": (0.1, -0.3, 0.2), "model": "nominal"},
    "arm without model": {
        "model": "none",
        "velocity": "levant",
        "v0": (0.1, 0.2, -0.3),
    },
    "volts": {
        "plant": smc.plant("inverted_pendulum_network", n=3),
        "actuator": smc.DCMotor(command="voltage", gear=50.0, voltage=1e3),
        "model": "nominal",
    },
}


def ways_of(law):
    """The scenarios that suit a law: not all laws can do without the model, and one needs a tip."""
    for way, fields in WAYS.items():
        if (law.requires_model and fields.get("model") == "none") or (
            law.name == "hybrid_sliding" and way != "arm"
        ):
            continue
        yield fields


@pytest.fixture(scope="module")
def traces(compiled):
    """Name -> pairs of traces, of the law and of its C: of one way after the other, and of "turns"
    in all ways.
    """
    pairs = {}
    for i, (name, (law, c)) in enumerate(compiled.items()):
        ways = list(ways_of(law))
        if name == "turns":
            chosen = ways
        else:
            chosen = [ways[i % len(ways)]]
        pairs[name] = [
            (reference.run(scenario(law, **fields)), smc.run(scenario(c, **fields)))
            for fields in chosen
        ]
    return pairs


@pytest.mark.parametrize("name", [*LAWS, "with gains by joint", "turns", "parts"])
def test_a_law_written_out_and_read_back_gives_its_own_trace_to_the_last_bit(traces, name):
    assert traces[name]
    for ours, theirs in traces[name]:
        assert ours.failure is theirs.failure is None
        for field in ("x", "v", "u", "s"):
            np.testing.assert_array_equal(getattr(theirs, field), getattr(ours, field))
        assert len(np.unique(ours.u, axis=0)) > 50


@pytest.mark.quick
def test_gains_by_joint_and_shared_ones_are_read_back(compiled):
    law, c = compiled["with gains by joint"]
    assert dict(c.gains) == dict(law.gains)
    assert compiled["turns"][1].shared == ("all",)
    assert compiled["unit_vector"][1].shared == ("rho", "eps")
    assert compiled["turns"][1].joint
    with pytest.raises(
        smc.ScenarioError, match=r"all is \(1, 2, 3\): give one number for all channels"
    ):
        compiled["turns"][1].template(all=[1, 2, 3])


@pytest.mark.parametrize("name", ["turns", "hybrid_sliding", "time_delay_sliding"])
def test_the_reference_loop_calls_it_alike(compiled, name):
    """Also what the law asks of MuJoCo: Coriolis forces and the Jacobian."""
    fields = next(ways_of(compiled[name][1])) | {"duration": 0.02}
    trace = smc.run(scenario(compiled[name][1], **fields))
    assert trace.failure is None
    assert_same(trace, reference.run(trace.scenario))


@pytest.mark.parametrize(
    "name", ["passivity_based", "super_twisting_computed_torque", "time_delay_sliding"]
)
def test_in_single_precision_each_call_is_that_of_double_within_its_rounding(folder, name):
    (path := folder / f"{name}-single.c").write_text(smc.exchange.law_to_c(name, "float", joints=3))
    flags = (*STRICT, "-Wdouble-promotion")
    single = smc.exchange.law_from_c(path, flags=flags, timeout=60.0).function
    law = LAWS[name]()
    rng = np.random.default_rng(3)
    memory = np.zeros((3, law.memory))
    theirs = python_functions.PythonComponent(law, 3)
    for k in range(20):
        vectors = rng.normal(size=(9, 3)).astype(np.float32).astype(float)
        M = np.eye(3) + 0.1
        h = rng.normal(size=3)
        g = rng.normal(size=3)
        y = JointMeasurement(1e-3 * k, 1e-3, 1.0, Nothing(), *vectors, M, h, g)
        theirs.memory[:] = memory[:, : law.memory]
        expected = theirs.call_joint(y)
        in_single = single(y, gains_of(law, 3), memory)
        for ours, in_double in zip(in_single, expected, strict=True):
            # it divides a difference of velocities by dt
            if name == "time_delay_sliding":
                scale = 1.0 / y.dt
            else:
                scale = 1.0
            np.testing.assert_allclose(
                ours, in_double, atol=1e-5 * scale * (1.0 + np.abs(in_double).max()), rtol=0
            )


@smc.law_function(joint=True)
def edges(y, gains, memory):
    """What numpy's functions make of zeros and NaN."""
    low = np.minimum(y.x, y.v)
    high = np.maximum(y.x, y.v)
    sign = np.sign(y.x)
    return np.array([low[0], high[1], sign[2]]), np.where(y.x > y.v, low, high)


@pytest.mark.slow
@pytest.mark.parametrize(
    "x",
    [
        (0.0, -0.0, 0.0),
        (-0.0, 0.0, -0.0),
        (math.nan, 1.0, math.nan),
        (1.0, math.nan, -math.inf),
    ],
)
def test_zeros_and_nan_are_those_of_the_compiled_python(folder, x):
    (path := folder / "edges.c").write_text(smc.exchange.law_to_c(edges, joints=3))
    c = smc.exchange.law_from_c(path, flags=STRICT).function
    zero = np.zeros(3)
    for v in (
        (0.0, 0.0, 0.0),
        (-0.0, -0.0, 1.0),
        (2.0, math.nan, math.nan),
    ):
        x_ = np.array(x)
        v_ = np.array(v)
        y = JointMeasurement(0.0, 1e-3, 0.0, Nothing(), x_, v_, *[zero] * 7, np.eye(3), zero, zero)
        numbers = extremes(x_, v_)
        from_c, _ = c(y, (), np.zeros((3, 8)))
        np.testing.assert_array_equal(from_c, numbers)
        np.testing.assert_array_equal(np.signbit(from_c[:2]), np.signbit(numbers[:2]))


@njit
def extremes(x, v):
    return np.array([np.minimum(x, v)[0], np.maximum(x, v)[1], np.sign(x)[2]])


class Nothing:
    """A plant without Coriolis forces."""

    def coriolis(self, w):
        return 0.0 * w


def own(body: str, joints: str = "#define SMC_JOINTS 2", head: str = TYPE) -> str:
    """A C file with a law of this body for two joints."""
    quiet = "int i;\n    (void)y; (void)gains; (void)memory;\n"
    quiet += "    for (i = 0; i < 4; i++) out[i] = 0.0;\n"
    return f'{joints}\n#include "smc_law.h"\n{head}\n{{\n    {quiet}    {body}\n    return 0;\n}}\n'


MISTAKES = {
    "gains": (
        own("", joints='#define SMC_JOINTS 2\nconst char smc_law_gains[] = "k=1 2 3";'),
        "gain k of mine.c is (1, 2, 3): give it one number, or 2",
    ),
    "shared": (
        own(
            "",
            joints='#define SMC_JOINTS 2\nconst char smc_law_gains[] = "k=1 2";\n'
            'const char smc_law_shared[] = "k";',
        ),
        "shared gain k of mine.c is (1, 2): give it one number",
    ),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_a_mistake_in_the_file_is_one_sentence(tmp_path, case):
    text, said = MISTAKES[case]
    (path := tmp_path / "mine.c").write_text(text)
    with pytest.raises(smc.ScenarioError, match=re.escape(said)) as error:
        smc.exchange.law_from_c(path)
    assert "\n" not in str(error.value)


def test_a_law_that_changes_its_measurement_ends_its_run(tmp_path):
    (path := tmp_path / "mine.c").write_text(own("((double *)y->x)[1] = 0.0;"))
    law = smc.exchange.law_from_c(path)
    trace = smc.run(scenario(law, plant="double_pendulum", duration=0.01))
    assert "smc_law changes its measurement" in str(trace.failure)


def test_a_mistake_in_the_scenario_is_one_sentence(compiled, tmp_path):
    with pytest.raises(
        smc.ScenarioError, match="its code is for 3, where panda has 7: write it for 7"
    ) as error:
        smc.Scenario(plant="panda", law=compiled["unit_vector"][1])
    assert "\n" not in str(error.value)
    three = smc.plant("inverted_pendulum_network", n=3)
    trace = smc.run(scenario(compiled["hybrid_sliding"][1], plant=three, duration=0.01))
    assert "asks for the Jacobian of a tip, and there is none" in str(trace.failure)
    (path := tmp_path / "mine.c").write_text(smc.exchange.law_to_c("unit_vector", joints=2))
    library = tmp_path / "mine.so"
    subprocess.run(
        [*build.compiler(), *build.LIBRARY_FLAGS, str(path), "-o", str(library), "-lm"], check=True
    )
    with pytest.raises(
        smc.ScenarioError,
        match=r"mine\.so is a library with a law of many joints: give its \.c file",
    ):
        smc.exchange.law_from_c(library)


SHARES = "an array, which shares its numbers with another name"
REFUSED = {
    "u = memory[:, 0]\n    u = memory[:, 1]\n    memory[:, 0] = s": SHARES,
    "u = torque(y, s)\n    s[0] = 0.0": SHARES,
    "u = s\n    u += 1.0": SHARES,
    "u = y.M[0]; u[1] = 0.0": SHARES,
    "u = part(s)\n    s[0] = 0.0": SHARES,
    "u = outer(s)\n    s[0] = 0.0": SHARES,
    "u = part(y.x)\n    u[0] = 0.0": SHARES,
    "u = joint_law.torque(y, s)\n    s[0] = 0.0": SHARES,
    "u = position(y)\n    u[0] = 0.0": SHARES,
    "u = s.copy()\n    w = u[:2]\n    u = u + 1.0\n    w[0] = 1.0": SHARES,
    "u = s\n    kept(part(s))": "shares its numbers, which a function changes,",
    "u = s + kept(s) * s[0]": "a call that changes an array which the rest of the line reads",
    "u = s + both(s, s)": "a call that gets an array twice and changes it",
    "w = np.zeros((3, 3))\n    u = y.x * kept(w[:, 1:])": "a part of a matrix, which",
    "u = s\n    u[0] = kept(y.x)": "which is no array of the function's own,",
    "u = y.M @ s": "the operator @",
    "u = s * np.sum(s)": "sum of an array",
    "u = y.M * s": "arrays of different shapes in one expression",
    "u = s[1:]": "a result other than u and s",
    "u = s[::2]": "a part of an array that is empty or has a step",
    "u = s[: int(y.t)]": "a length that is not known before the law runs",
    "u = s * s[3]": "an index outside -3 to 2",
    "u = s * memory[:, 8]": "it uses memory[:, 8], and its memory has 8 numbers: give memory=9",
    "u = y.dynamics * s": "it reads an unknown measurement 'dynamics'",
    "u = s\n    if y.t > 1.0: u = 0.0": "a name for a number and an array",
    "u = moved(s)": "an assignment to an argument that is an array",
    "u = np.array([1, 0, 0])\n    u[0] = s[0]": "an array of whole numbers",
}


@pytest.mark.parametrize(("line", "words"), REFUSED.items())
def test_what_has_no_translation_is_refused_by_name(tmp_path, monkeypatch, line, words):
    text = (
        "import math\nimport numpy as np\nimport smc_mujoco as smc\n"
        "from smc_mujoco.control import joint_law\n"
        "from smc_mujoco.control.joint_law import norm, torque\n"
        "def part(a):\n    b = a if a[0] > 0.0 else -a\n    return b\n"
        "def kept(a):\n    a[0] = 1.0\n    return 2.0\n"
        "def both(a, b):\n    return kept(a) + b[0]\n"
        "def nothing(a):\n    a[0] = 1.0\n"
        "def position(y):\n    return y.x\n"
        "def moved(a):\n    a = a + 1.0\n    return a\n"
        "def around():\n    def inner(a):\n        return a\n"
        "    def outer(a):\n        return inner(a)\n    return outer\n"
        "outer = around()\n"
        "@smc.law_function(joint=True)\n"
        f"def strange(y, gains, memory):\n    s = y.de + y.e\n    {line}\n    return u, s\n"
    )
    law = strange(text, tmp_path, monkeypatch)
    with pytest.raises(smc.ScenarioError, match="law 'strange' cannot be written in C: ") as error:
        smc.exchange.law_to_c(law, joints=3)
    assert words in str(error.value)
    assert "\n" not in str(error.value)
