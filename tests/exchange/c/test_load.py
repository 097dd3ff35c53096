"""Users' laws in C: the same traces as the library's, and for every mistake one sentence, not a
dead process.
"""

import copy
import pickle
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from analysis.test_engine import FEW, SINE, check
from common.test_children import ENDS, assert_none_outlives
from exchange.helpers.compiler import needs_compiler
from helpers import reference
from helpers.commands import python

import smc_mujoco as smc
from smc_mujoco.control import joint_law
from smc_mujoco.control.law import Measurement
from smc_mujoco.exchange.c import build
from smc_mujoco.simulation import run_key

pytestmark = needs_compiler

DOCS = Path(smc.__file__).parents[1] / "docs" / "c.md"
(MINE,) = re.findall(r"^```c\n(.*?)^```$", DOCS.read_text(), re.MULTILINE | re.DOTALL)
HEADER = build.HEADER.read_text()
CALLED = "has another smc_law than smc_mujoco calls: the law must be"
TYPE = (
    "int smc_law(const smc_measurement *y, const smc_real *gains, smc_real *memory, smc_real *out)"
)
FIELDS = ("x", "v", "u", "applied", "s")


def law(body: str, more: str = "") -> str:
    """A C file with a law of this body."""
    quiet = "(void)y; (void)gains; (void)memory;"
    begins = f'#include "smc_law.h"\n{more}\n{TYPE}\n{{\n    {quiet}\n    out[1] = y->e;\n'
    return f"{begins}    {body}\n    return 0;\n}}\n"


@pytest.fixture
def file(tmp_path):
    """Write a C file, and give its path."""

    def written(text: str, name: str = "my_law.c") -> Path:
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return written


def shared(source: Path, target: Path, *flags: str) -> Path:
    """Build a shared library of a C file."""
    line = [*build.compiler(), *flags, "-shared", "-fPIC", "-I", str(build.FOLDER), str(source)]
    subprocess.run([*line, "-o", str(target), "-lm"], check=True)
    return target


def scenario(law: object, plant: str = "duffing", **more: object) -> smc.Scenario:
    common = {
        "duration": 0.3,
        "noise": smc.Noise(0.01, 0.05),
        "disturbance": smc.Sine(0.5, 7.0),
    }
    return smc.Scenario(plant=plant, law=law, **common | more)


def same(one: smc.Trace, other: smc.Trace) -> bool:
    return all(np.array_equal(getattr(one, f), getattr(other, f)) for f in FIELDS)


# the same traces


def test_a_law_in_c_gives_the_bits_of_the_library_s_and_of_the_plain_loop(file):
    mine = smc.exchange.law_from_c(file(MINE))
    pairs = [(mine(lam=5.0), smc.law("observer_free", lam=5.0))] * 3
    plants = ("inverted_pendulum", "duffing", "pendulum_network")
    traces = iter(
        smc.run(
            [
                scenario(law, plant)
                for pair, plant in zip(pairs, plants, strict=True)
                for law in pair
            ]
        )
    )
    for fast, theirs in zip(traces, traces, strict=True):
        assert fast.failure is None
        assert same(fast, theirs)
        assert same(fast, reference.run(fast.scenario))


def test_it_runs_in_the_callback_without_a_word_and_on_threads_alike(file):
    mine = smc.exchange.law_from_c(file(MINE))
    sweep = []
    for lam in (2.0, 6.0):
        for seed in range(4):
            sweep.append(scenario(mine(lam=lam), seed=seed, duration=0.1))
    # a PlainLoopWarning would be an error
    on_one_thread, on_two_threads = smc.run(sweep, threads=1), smc.run(sweep, threads=2)
    for a, b in zip(on_one_thread, on_two_threads, strict=True):
        assert same(a, b)


def test_every_number_of_the_measurement_is_where_the_header_says(file):
    total = " + ".join(
        f"{i}.0 * y->{name}" for i, name in enumerate(Measurement._fields) if name != "limit"
    )

    @smc.law_function
    def summed(y, gains, memory):
        return (
            0.0 * y.t
            + 1.0 * y.dt
            + 2.0 * y.x
            + 3.0 * y.v
            + 4.0 * y.e
            + 5.0 * y.de
            + 6.0 * y.r
            + 7.0 * y.dr
            + 8.0 * y.ddr
            + 9.0 * y.f
            + 10.0 * y.g
            + 11.0 * y.a
            + 13.0 * y.model
            + 14.0 * y.has_surface
            + 15.0 * y.s
            + 16.0 * y.v_eq
            + 17.0 * y.q
            + 18.0 * y.dq
            + 19.0 * y.fq
            + 20.0 * y.gq
        ), y.limit

    more = {
        "model": "nominal",
        "surface": "linear",
        "reference": smc.Sine(0.1, 3.0),
        "u_max": 1e9,
    }
    mine = smc.exchange.law_from_c(
        file(law(f"out[0] = {total}; out[1] = y->limit;")), plants=("cart_pole",)
    )
    theirs = smc.law_function(plants=("cart_pole",))(summed.function)
    assert same(
        *smc.run([scenario(law, "cart_pole", **more, duration=0.05) for law in (mine, theirs)])
    )


@pytest.mark.slow
def test_single_precision_is_single_within_and_double_without(file):
    single = smc.exchange.law_from_c(
        file("#define SMC_REAL float\n" + MINE.replace("tanh", "tanhf"))
    )
    fast, exact = smc.run(
        [scenario(law, duration=1.0) for law in (single, smc.law("observer_free"))]
    )
    assert np.array_equal(fast.s, fast.s.astype(np.float32))
    assert 0.0 < np.abs(fast.x - exact.x).max() < 1e-6
    assert same(fast, reference.run(fast.scenario))


# libraries, other files, other processes


def test_a_shared_library_is_taken_as_it_is_and_again_after_a_new_build(file, tmp_path):
    target = tmp_path / "my_law.so"
    traces = []
    for gain in (1.0, 2.0):
        source = file(
            law(f"out[0] = -{gain} * gains[0] * y->e;").replace("smc_law(", "firmware_step("),
            "built.c",
        )
        shared(source, target)
        mine = smc.exchange.law_from_c(target, symbol="firmware_step", gains={"k": 0.5})
        traces.append(smc.run(scenario(mine, noise=None)))
        assert same(traces[-1], reference.run(traces[-1].scenario))
    assert traces[1].u[0, 0] == pytest.approx(2.0 * traces[0].u[0, 0], rel=1e-12)


@pytest.mark.quick
def test_two_laws_of_one_library_are_two_laws(file, tmp_path):
    source = law("out[0] = -1.0 * y->e;").replace("smc_law(", "first(")
    source += law("out[0] = -2.0 * y->e;").replace("smc_law(", "second(").partition("\n")[2]
    target = tmp_path / "both.so"
    shared(file(source, "both.c"), target)
    first, second = (
        scenario(smc.exchange.law_from_c(target, symbol=name)) for name in ("first", "second")
    )
    assert first != second
    assert run_key.run_key(first) != run_key.run_key(second)


def test_a_scenario_is_its_copies_equal_and_no_other_law_s(file):
    path = file(MINE)
    first = scenario(smc.exchange.law_from_c(path)(lam=4.0))
    copies = [
        pickle.loads(pickle.dumps(first)),
        copy.deepcopy(first),
        scenario(smc.exchange.law_from_c(path)(lam=4.0)),
    ]
    for duplicate in copies:
        assert duplicate == first
        assert hash(duplicate.law.function) == hash(first.law.function)
    wider = smc.exchange.law_from_c(path, memory=20)
    renamed = smc.exchange.law_from_c(path, name="other")
    edited = smc.exchange.law_from_c(file(MINE.replace("out[1] = s", "out[1] = 0.5 + s")))
    functions = {duplicate.function for duplicate in (first.law, wider(), renamed(), edited())}
    assert len(functions) == 4


def test_other_files_and_flags_come_along(file, tmp_path):
    helper = file("double twice(double a) { return 2.0 * a; }", "filter.c")
    mine = file(law("out[0] = -K * twice(y->e);", "double twice(double a);"))
    trace = smc.run(
        scenario(smc.exchange.law_from_c(mine, flags=["-DK=1.5", str(helper)]), noise=None)
    )
    assert trace.u[0, 0] == -3.0 * trace.x[0, 0]


def test_another_process_runs_what_was_loaded_here_whatever_the_file_holds_by_then(file, tmp_path):
    text = 'const char smc_law_gains[] = "k=2";'
    first = scenario(
        smc.exchange.law_from_c(
            file(
                law(
                    "out[0] = table * gains[0] * y->e;",
                    f"static double table;\n{text}\n"
                    "int smc_setup(void) { table = -1.0; return 0; }",
                )
            ),
            name="mine",
        )(k=4.0),
        noise=None,
    )
    pickled = pickle.dumps([first, first])
    trace = smc.run(first)
    file(law("out[0] = y->e;"))
    unpickled, two = pickle.loads(pickled)
    assert str(unpickled.law) == "mine(k=4)"
    assert (
        unpickled.law.function is two.law.function is pickle.loads(pickled)[0].law.function
    )  # loaded once
    assert same(smc.run(unpickled), trace)
    assert same(reference.run(unpickled), trace)
    Path(tmp_path / "my_law.c").unlink()
    code = f"import pickle, smc_mujoco as smc; run = pickle.loads({pickle.dumps(first)!r})\n"
    code += "print(smc.run(run).u[:, 0].tolist())"
    assert eval(python("-c", code).stdout) == trace.u[:, 0].tolist()


def test_what_a_study_knows_of_it_is_its_code(file, tmp_path):
    def key(gain: float, name: str = "my_law.c", **more: object) -> str:
        return run_key.run_key(
            scenario(
                smc.exchange.law_from_c(file(law(f"out[0] = -{gain} * y->e;"), name), **more)()
            )
        )

    first = key(1.0)
    assert key(2.0) != first
    assert key(1.0) == first
    assert key(1.0, timeout=20.0) == first
    assert key(1.0, flags=["-O0"]) != first
    (tmp_path / "elsewhere").mkdir()
    assert key(1.0, "elsewhere/my_law.c") == first
    again = pickle.loads(
        pickle.dumps(scenario(smc.exchange.law_from_c(file(law("out[0] = -1.0 * y->e;")))()))
    )
    assert run_key.run_key(again) == first


def test_its_functions_and_data_are_its_own_whatever_else_has_their_names(file):
    """y0 and remove are functions of C's, timezone a number: a linker may take those without a
    word.
    """
    more = "double y0(double a) { return -a; }\ndouble timezone = 0.5;\n"
    more += "double remove(double a) { return y0(2.0 * a); }"
    trace = smc.run(
        scenario(
            smc.exchange.law_from_c(file(law("out[0] = timezone * remove(y->e);", more))),
            noise=None,
        )
    )
    assert trace.u[0, 0] == -trace.x[0, 0]


# mistakes


@pytest.mark.slow
def test_what_cannot_be_loaded_is_one_sentence(file):
    for text, words in (
        (
            law("out[0] = y->e return;"),
            "my_law.c does not compile: my_law.c, line 7: expected ';' before 'return'",
        ),
        ("int smc_law(double e, double de) { return e + de; }", f"{CALLED} {TYPE}"),
        ("int my_law(void) { return 0; }", f"has no function smc_law: define {TYPE}"),
        (
            law("out[0] = other(y->e);", "double other(double);"),
            "cannot be loaded (my_law.c: undefined symbol: other)",
        ),
        (
            MINE.replace("k1=2.5", "k1"),
            "my_law.c's smc_law_gains is 'lam=6,k1': give names and numbers",
        ),
        (law("", "int smc_setup(void) { return 3; }"), "my_law.c: smc_setup returned 3"),
    ):
        with pytest.raises(smc.ScenarioError, match=re.escape(words)) as error:
            smc.exchange.law_from_c(file(text))
        assert "\n" not in str(error.value)


def test_a_law_that_fails_ends_its_run_with_a_reason_and_harms_no_other(file):
    late = smc.exchange.law_from_c(file(law("out[0] = y->t > 0.1 ? y->e / (y->t - y->t) : 0.0;")))
    code = smc.exchange.law_from_c(
        file(law("out[0] = 0.0; return y->t > 0.1 ? -5 : 0;")), name="mine"
    )
    first, third = smc.run([scenario(law) for law in (late, "observer_free")])
    second = smc.run(scenario(code))
    assert first.failure is not None
    assert re.match(
        r"law 'my_law' returned u = -?inf, s = .* in channel 0, at t = 0.101 s", first.failure
    )
    assert (
        second.failure
        == "law 'mine' raised ArithmeticError (smc_law returned -5) in channel 0, at t = 0.101 s"
    )
    assert third.failure is None


def test_a_law_that_says_no_s_ends_its_run(file, tmp_path):
    silent = file(law("out[0] = 0.0;").replace("    out[1] = y->e;\n", ""))
    shared(silent, tmp_path / "a.so")
    for source in (silent, tmp_path / "a.so"):
        trace = smc.run(scenario(smc.exchange.law_from_c(source)))
        assert (trace.failure or "").endswith("returned u = 0, s = nan in channel 0, at t = 0 s")


def test_names_of_the_law_may_be_those_of_headers_that_it_does_not_include(file):
    more = [
        "static double gamma = 2.0, y0 = 3.0;",
        "typedef struct { int a; } int64_t;",
        "#define i g",
        "#define g 9.81",
    ]
    taken = law("out[0] = y0 * gamma;", "\n".join(more))
    assert (smc.run(scenario(smc.exchange.law_from_c(file(taken)))).u == 6.0).all()


def test_wrong_arguments_are_one_sentence(file):
    for source, more, words in (
        ("nowhere.c", {}, "there is no file nowhere.c"),
        (None, {"gains": {"k2": 1.0}}, "unknown gain of my_law.c 'k2': choose from k1, lam"),
        (None, {"gains": {"k1": np.ones(2)}}, "gain k1 of my_law.c is (1, 1): give it one number"),
        (
            None,
            {"symbol": "my_step"},
            "my_law.c has no function my_step: define int my_step(const smc_measurement",
        ),
    ):
        with pytest.raises(smc.ScenarioError, match=re.escape(words)):
            smc.exchange.law_from_c(file(MINE) if source is None else source, **more)


def test_what_is_no_library_or_of_single_precision_is_refused(file, tmp_path):
    with pytest.raises(
        smc.ScenarioError, match=r"junk.so cannot be loaded \(junk.so: file too short\)"
    ):
        smc.exchange.law_from_c(file("junk", "junk.so"))
    source = file(
        "#define SMC_REAL float\n" + MINE + "const int smc_law_real = sizeof(smc_real);\n"
    )
    shared(source, tmp_path / "a.so")
    with pytest.raises(
        smc.ScenarioError, match=r"a\.so is a library of single precision: give its \.c file"
    ):
        smc.exchange.law_from_c(tmp_path / "a.so")


# the header, the documentation, the command


def test_the_docs_show_a_law_that_passes(file):
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    smc.exchange.law_from_c(file(MINE), flags=strict)


def test_the_header_has_the_numbers_of_the_measurement_in_their_order():
    channel, joints = re.findall(r"typedef struct \{(.*?)\}", HEADER, re.DOTALL)
    assert tuple(re.findall(r"smc_real (\w+);", channel)) == Measurement._fields
    assert tuple(re.findall(r"smc_real (\w+)\[", joints)) == joint_law.ARRAYS
    assert len(Measurement._fields) == build.MEASUREMENT_SIZE


def test_nothing_is_left_behind(file):
    code = f"import smc_mujoco as smc; smc.exchange.law_from_c({str(file(MINE))!r})\n"
    folder = python(
        "-c", code + "from smc_mujoco.exchange.c import build; print(build.folder())"
    ).stdout.strip()
    assert folder
    assert not Path(folder).exists()


def test_a_law_in_c_is_one_sentence_on_windows(monkeypatch):
    monkeypatch.setattr(sys, "platform", "win32")
    with pytest.raises(smc.ScenarioError, match=r"law\.c' on Windows: run it on Linux, or in WSL"):
        smc.exchange.law_from_c("law.c")


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="it reads who lives from /proc")
@pytest.mark.parametrize("how", ENDS)
def test_a_compiler_does_not_outlive_who_started_it(how, tmp_path):
    code = "os.environ['CC'] = './cc'; smc.exchange.law_from_c('law.c')"
    assert_none_outlives(code, how, tmp_path)


def test_the_engine_calls_a_law_in_c_as_mujoco_does(tmp_path):
    path = tmp_path / "mine.c"
    path.write_text(smc.exchange.law_to_c("boundary_layer"))
    noisy = {"noise": smc.Noise(1e-4, 5e-4), "disturbance": SINE, "input_delay": 2e-3}
    check("duffing", smc.law_from(path), {"plain": {}, "noise": noisy}, duration=2.0, of=FEW)
