"""The library's laws written out as C: clean, small, and bit for bit what they are in Python."""

import ctypes
import itertools
import math
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from exchange.helpers.compiler import needs_compiler
from helpers.sources import strange
from numba import njit

import smc_mujoco as smc
from smc_mujoco.cli import main as cli
from smc_mujoco.common.rebuild import rebuild
from smc_mujoco.control.law import Measurement, law_catalogue, sliding
from smc_mujoco.control.laws import observer_free_q15 as q15
from smc_mujoco.exchange.c import build
from smc_mujoco.exchange.c.law_from_c import CLaw
from smc_mujoco.simulation import cfunctions
from smc_mujoco.simulation.python_functions import gains_of

pytestmark = needs_compiler

LAWS = law_catalogue()
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wmissing-prototypes")
PLANTS = ("inverted_pendulum", "duffing", "pendulum_network")
# What scenarios are like: without the model, with it, and with a surface, where the law takes one.
WAYS = (
    {},
    {"model": "nominal"},
    {"model": "nominal", "surface": "linear"},
)
FIELDS = ("x", "v", "u", "applied", "s")
# which a scenario gives to a law of the library, and to none in C
OF_PLANT = {"a1": 0.5, "a2": -0.2, "b": 2.0}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("laws")


@pytest.fixture(scope="module")
def compiled(folder):
    """Law -> its C in double precision, compiled without a warning and loaded as a user's law."""

    def make(name: str):
        path = folder / f"{name}.c"
        path.write_text(smc.exchange.law_to_c(name))
        return smc.exchange.law_from_c(path, flags=STRICT, plants=LAWS[name].plants, timeout=60.0)

    laws_from_c = dict(zip(LAWS, map(make, LAWS), strict=True))
    for template in LAWS.values():
        cfunctions.compile_component(template())  # compiles
    return laws_from_c


@pytest.fixture(scope="module")
def traces(compiled):
    """(law, way) -> its trace, and that of its C, on one plant after the other."""
    pairs = {}
    plants = itertools.cycle(PLANTS)
    for name, template in LAWS.items():
        for way, more in enumerate(WAYS):
            if "surface" in more and (template.relative_degree != 1 or template.plants):
                continue
            if template.plants:
                plant = template.plants[0]
            else:
                plant = next(plants)
            gains = {}
            for gain, about in template.gains.items():
                if about.plant:
                    gains[gain] = OF_PLANT[about.plant]
            pairs[name, way] = [
                scenario(law, plant, **more) for law in (template(**gains), compiled[name](**gains))
            ]
    results_of_runs = iter(smc.run([s for pair in pairs.values() for s in pair]))
    return {key: (next(results_of_runs), next(results_of_runs)) for key in pairs}


def scenario(law, plant="duffing", **more) -> smc.Scenario:
    common = {
        "duration": 0.1,
        "noise": smc.Noise(0.003, 0.02),
        "disturbance": smc.Sine(0.5, 7.0),
        "v0": 0.3,
    }
    return smc.Scenario(plant=plant, law=law, **common | {"reference": smc.Sine(0.2, 3.0)} | more)


def back(folder: Path, law, numbers="double", **more) -> CLaw:
    """A law's C, compiled without a warning, as a function (y, gains, memory) -> (u, s)."""
    path = folder / f"{law.name}-{numbers}.c"
    path.write_text(smc.exchange.law_to_c(law, numbers))
    function = smc.exchange.law_from_c(
        path, flags=(*STRICT, *more.get("flags", ())), timeout=60.0
    ).function
    assert isinstance(function, CLaw)
    return function


def measured(k: int, rng) -> list[float]:
    """Some measurement, with model and surface now and then."""
    e = 0.5 * math.cos(0.02 * k) + 0.01 * rng.normal()
    de = 0.05 * rng.normal() - 0.3 * math.sin(0.02 * k)
    fields = [
        1e-3 * k,
        1e-3,
        e + 0.2,
        de,
        e,
        de,
        0.2,
        0.0,
        0.0,
        -1.3 * e,
        1.7,
        0.1 * de,
        6.0,
        float(k % 4 > 1),
    ]
    return [*fields, float(k % 5 == 0), de + e, -de, 0.1 * e, 0.1 * de, 0.3, -0.4]


# the same


def test_a_law_written_out_and_read_back_gives_its_own_trace_to_the_last_bit(traces):
    """With glibc, whose pow, exp, tanh and sin the compiled law calls too; another library's may
    differ by some ulp.
    """
    assert {name for name, _ in traces} == set(LAWS)
    for name, (first, second) in traces.items():
        assert first.failure is None
        assert second.scenario.law.gains == first.scenario.law.gains
        for field in FIELDS:
            np.testing.assert_array_equal(
                getattr(second, field), getattr(first, field), err_msg=str(name)
            )


@pytest.mark.slow
def test_every_law_in_single_precision_compiles_without_a_double_in_it(folder):
    paths = [folder / f"{name}-single.c" for name in LAWS]
    for path, text in zip(
        paths, (smc.exchange.law_to_c(name, "float") for name in LAWS), strict=True
    ):
        path.write_text(text)
        assert (
            re.search(r"(?<![\w.])\d+\.\d+(?![\df])", text[text.index("smc_law_modelled =") :])
            is None
        )
    flags = [*STRICT, "-Wdouble-promotion", "-fsyntax-only"]
    done = subprocess.run(
        [*build.compiler(), *flags, *paths], capture_output=True, text=True, check=False
    )
    assert done.stderr == ""
    assert done.returncode == 0


@pytest.mark.quick
@pytest.mark.parametrize("plant", PLANTS)
def test_fixed_point_is_the_library_s_to_the_last_bit(folder, plant):
    (folder / "q15.c").write_text(
        smc.exchange.law_to_c(smc.law("observer_free", lam=5.0, k1=1.7), "q15")
    )
    mine = smc.exchange.law_from_c(folder / "q15.c", flags=STRICT)
    theirs = smc.law("observer_free_q15", lam=5.0, k1=1.7)
    for more in WAYS:
        first, second = smc.run([scenario(law, plant, **more) for law in (mine, theirs)])
        assert first.failure is None
        for field in FIELDS:
            np.testing.assert_array_equal(getattr(first, field), getattr(second, field))


def test_fixed_point_s_core_is_whole_numbers_and_right_for_every_word(folder):
    text = smc.exchange.law_to_c("observer_free", "q15")
    core = text[text.index("static const int16_t TABLE") : text.index("/* From here on")]
    assert re.search(r"double|float|smc_real|math", core) is None
    words = {}
    for name, value in re.findall(r"Q15_(\w+) = (-?\d+)", text):
        words[name] = int(value)
    # 2.5 4/8 and 8/8 in 2^-11, 6/8 in 2^-15
    assert words == {"ON_E": 2560, "ON_DE": 2048, "LAM": 24576}
    core = back(folder, smc.law("observer_free"), "q15").library.smc_q15_u
    core.restype = ctypes.c_int16
    core.argtypes = [ctypes.c_int16] * 2
    # which the sliding variable's function never gives
    assert core(-32768, 24576) == core(-32767, 24576)
    s = np.arange(-32767, 32768)
    i = np.abs(s) >> 7
    part = np.abs(s) & 127
    T = q15.TABLE[i] + ((np.diff(q15.TABLE, append=0)[i] * part + 64) >> 7)
    assert [core(int(n), 24576) for n in s] == (-np.sign(s) * ((24576 * T + 2**14) >> 15)).tolist()


# users' laws


WIDTH = 0.5
QUARTERS = (1, 2, 3)
NOUGHT = -0.0


@smc.law_function(
    gains={"k": 2.0, "out": 3.0, "if_": 1.5},
    memory=4,
)
def turns(z, K, state):  # noqa: PLR0912
    """Every turn of Python that there is: */ and /* too."""
    a = z.e
    b = z.de
    a, b = b, a  # at once
    count: int = 0
    double = 0
    while count < 3:
        count += 1
        if count == 2:
            continue
        double += QUARTERS[count - 3] * QUARTERS[-1] / 12  # from the end, the first time
    if abs(a) > WIDTH and not b < 0.0:
        late = a
    elif -1.0 < b <= 0.0 or a == 0:
        late = -((-b) ** 2)
    else:
        late = min(a, b, 1) - max(0, a)
    for i in range(1, 3):
        state[2] += i * late
    for i in range(4):
        state[3] = state[3] - 0.5 if i & 1 == 1 else state[3]
    for i in range(2, -4, -1):  # from the end below 0, as in those that follow
        double += QUARTERS[i] * i
    for i in range(-2, 2):
        double += QUARTERS[i] * i
    for i in range(-3, 0, 1):
        double += QUARTERS[i] * i
    for i in range(4):
        double += QUARTERS[i - 3] * QUARTERS[i + -3]
    i = 1 - count
    double += QUARTERS[i]
    s, _ = sliding(z, K.k)
    state[0], state[1] = state[1], state[0] + s
    if state[0] > state[1]:
        high = 0.75
        low = 0.25
    else:
        high = a
        low = b
    memory = high - (low - (a - b)) / (2.0 / (b * b + 1.0))
    u = -K.out * math.tanh(s) - -NOUGHT * a - K.if_ * double + late * abs(count) + memory
    return u, s + state[2] + (1 if a > b else 0.5) + state[3]


def test_a_law_with_every_turn_of_python_gives_what_it_gives(folder):
    law = turns()
    rng = np.random.default_rng(1)
    ours = back(folder, law)
    theirs = rebuild(law.function, lambda g: g)
    mine = np.zeros(4)
    python_memory = np.zeros(4)
    gains = gains_of(law)
    for k in range(300):
        y = Measurement(*measured(k, rng))
        assert ours(y, gains, mine) == pytest.approx(
            theirs(y, gains, python_memory), rel=1e-14, abs=1e-14
        )
        np.testing.assert_allclose(mine, python_memory, rtol=1e-14, atol=1e-14)


def both(a):
    return a, 2.0 * a


@smc.law_function
def conditions(y, gains, memory):
    if y.e > 1.0:
        u = 1.0
    elif both(y.e)[1] > 0.5:
        u = 2.0
    else:
        u = y.de
    if y.e > 2.0:
        u = 7.0
    else:
        pass
    return u, y.de


def test_a_condition_that_needs_lines_of_its_own_has_them_within_its_else(folder):
    """An `else if` before those lines would give de below e = 1."""
    ours = back(folder, conditions())
    theirs = rebuild(conditions().function, lambda g: g)
    for e in (-0.5, 0.2, 0.3, 1.5, 3.0):
        for de in (-1.0, 1.0):
            y = Measurement(*[0.0] * 11)._replace(e=e, de=de)
            assert ours(y, (), np.zeros(8)) == theirs(y, (), np.zeros(8))


y0 = (0.25, 0.5)


def erf(a):
    return 2.0 * a


def main(a):
    return a - 1.0


@smc.law_function
def taken(y, gains, memory):
    """Names that C has for something else."""
    bool = 1.0
    nan = y.de
    linux = 2.0
    isnan = erf(y.e)
    return main(bool) + y0[1] * nan + linux, isnan


@pytest.mark.parametrize("dialect", ["-std=c99", "-std=gnu17"])
def test_names_that_c_has_for_something_else_are_other_names_in_it(folder, dialect):
    function = back(folder, taken(), flags=[dialect])
    y = Measurement(*measured(7, np.random.default_rng(2)))
    assert function(y, (), np.zeros(1)) == taken.function(y, (), np.zeros(1))


@smc.law_function
def signs(y, gains, memory):
    return np.sign(y.e), np.sign(y.de)


@njit
def numpy_signs(a):
    return np.sign(a), np.sign(-a)


@pytest.mark.parametrize("e", [math.nan, 0.0, -0.0, 1.0, -1.0])
def test_numpy_s_sign_is_that_of_the_compiled_python(folder, e):
    y = Measurement(*[0.0] * 11)._replace(e=e, de=-e)
    from_c = back(folder, signs())(y, (), np.zeros(1))
    from_numpy = numpy_signs(e)
    np.testing.assert_array_equal(from_c, from_numpy)
    if not math.isnan(e):  # whose sign no operation promises
        np.testing.assert_array_equal(np.signbit(from_c), np.signbit(from_numpy))


REFUSED = {
    "u = [y.e, y.de][0]": "List",
    "u = y.e // 2.0": "the operator FloorDiv",
    "u = both(y.e)[0] if y.de > 0.0 else 0.0": "computed within a condition",
    "u = 'a'": "the value 'a'",
    "u = y.e if y.de else np.sinc(y.e)": "sinc",
    "memory[8] = 1.0; u = 0.0": r"it uses memory\[8\], and its memory has 8 numbers: give memory=9",
    "u = TABLE[2]": "an index outside -2 to 1",
    "for u in (y.e, y.de): pass": "a loop over anything but a range",
    "u = 0.0\n    for i in range(3): i += 1": "a loop that changes its own variable",
    "u = again(y.e)": "again, which calls itself,",
    "u = 2 ** 40 * y.e": "a power of a whole number",
    "u = 5000000000 * y.e": "beyond 32 bits",
    "try:\n        u = y.e\n    finally:\n        pass": "try",
    "u = (lambda a: a)(y.e)": "a call",
    "y = 3.0; u = y": "an assignment to this",
    "u = y.foo": "it reads an unknown measurement 'foo': choose from a, ",
    "u = gains.k * y.e": "it reads an unknown gain 'k': there are none with a name",
    "u = halts(y.e)": "halts, which does not end in a return,",
}


@pytest.mark.parametrize(("line", "words"), REFUSED.items())
def test_what_has_no_translation_is_refused_by_name(tmp_path, monkeypatch, line, words):
    text = (
        "import numpy as np\nimport smc_mujoco as smc\nTABLE = 1.0, 2.0\n"
        "def halts(a):\n    while a:\n        return a\n"
        "def both(a):\n    return a, 2.0 * a\n"
        "def again(a):\n    return again(a - 1.0) if a > 0.0 else a\n"
        f"@smc.law_function\ndef strange(y, gains, memory):\n    {line}\n    return u, 0.0\n"
    )
    law = strange(text, tmp_path, monkeypatch)
    with pytest.raises(
        smc.ScenarioError, match=f"law 'strange' cannot be written in C: .*({words})"
    ) as error:
        smc.exchange.law_to_c(law)
    assert "\n" not in str(error.value)


# what a file says, and the command


def test_the_file_says_formula_source_gains_and_sizes(tmp_path):
    with pytest.raises(SystemExit) as end:
        cli.main(
            [
                "export",
                str(tmp_path / "super_twisting.c"),
                "--gains",
                "k1=5,c=1.5",
                "--type",
                "float",
            ]
        )
    text = (tmp_path / "super_twisting.c").read_text()
    assert not end.value.code
    head, _, rest = text.partition("*/")
    assert head.startswith("/* super_twisting: a control law in C99, written out by smc_mujoco ")
    gains = "k1 = 5, k2 = 4.4, c = 1.5, w_max = inf"
    state = "4 bytes a channel, memory[1]"
    for words in ("u = -k1 [s]^(1/2) + w", "A. Levant", gains, state):
        assert words in head
    assert 'const char smc_law_gains[] = "k1=5.0,k2=4.4,c=1.5,w_max=inf";' in rest
    assert head.count("licence  use without restriction, without warranty\n") == 1
    assert "malloc" not in rest
    assert build.HEADER.read_text() in rest
    assert max(map(len, text.splitlines())) <= 123


@pytest.mark.parametrize(
    ("law", "options", "kind"),
    [
        (smc.law("super_twisting", k1=0.1), {}, ctypes.c_double),
        (smc.law("super_twisting", k1=0.1), {"numbers": "float"}, ctypes.c_float),
        (smc.law("unit_vector", c=(8.0, 20.0, 0.1)), {"joints": 3}, ctypes.c_double),
    ],
    ids=("double", "float", "joints"),
)
def test_gains_are_ready_to_be_passed(tmp_path, law, options, kind):
    (tmp_path / "law.c").write_text(smc.exchange.law_to_c(law, **options))
    strict = (*STRICT, "-Wfloat-conversion", "-shared", "-fPIC")
    subprocess.run(
        [*build.compiler(), *strict, "law.c", "-o", "law.so", "-lm"], cwd=tmp_path, check=True
    )
    library = ctypes.CDLL(str(tmp_path / "law.so"))
    n = options.get("joints", 1)
    values = []
    for gain in law.gains.values():
        for number in gain if isinstance(gain, tuple) else [gain] * n:
            values.append(number)
    assert [*(kind * len(values)).in_dll(library, "smc_law_defaults")] == [
        kind(number).value for number in values
    ]


def test_the_command_writes_the_one_law_of_a_file(tmp_path, capsys):
    source = "@smc.law_function(gains={'k': 2.0})\n"
    source += "def mine(y, gains, memory):\n    return -gains.k * y.e, y.e\n"
    (file := tmp_path / "mine.py").write_text(f"import smc_mujoco as smc\n{source}")
    with pytest.raises(SystemExit) as end:
        cli.main(["export", str(file), str(tmp_path / "a.c"), "--gains", "k=4"])
    assert not end.value.code
    assert 'smc_law_gains[] = "k=4.0";' in (tmp_path / "a.c").read_text()
    file.write_text(f"{file.read_text()}{source.replace('mine', 'other')}")
    with pytest.raises(SystemExit):
        cli.main(["export", str(file), str(tmp_path / "a.c")])
    assert f"{file} has several laws, mine, other: give one, as FILE.py:mine" in (
        capsys.readouterr().err
    )
    with pytest.raises(SystemExit) as end:
        cli.main(["export", f"{file}:other", str(tmp_path / "other.c")])
    assert not end.value.code
