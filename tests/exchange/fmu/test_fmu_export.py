"""Laws as FMUs: valid by FMPy, bit for bit what smc.run computes, and independent of each other in
one process.
"""

import itertools
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

fmpy = pytest.importorskip("fmpy", reason="FMPy, pip install 'smc-mujoco[fmu]', is not installed")

from exchange.helpers.compiler import needs_compiler  # noqa: E402
from exchange.helpers.fmu import Importer  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

import smc_mujoco as smc  # noqa: E402
from smc_mujoco.control import estimator, surface  # noqa: E402
from smc_mujoco.control.law import law_catalogue  # noqa: E402
from smc_mujoco.exchange.c import build  # noqa: E402

pytestmark = needs_compiler

REFERENCE = smc.Sine(0.2, 3.0)
SURFACES = surface.surface_catalogue()
STRICT = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror")
FIRST = [
    n
    for n, law in law_catalogue().items()
    if law.relative_degree == 1 and not (law.plants or law.requires_model)
]
# (law, surface, estimator): each surface and each estimator once or more, laws with memory, of t,
# and of higher order.
COMBINED = [
    *zip(
        FIRST,
        [n for n, s in SURFACES.items() if s.relative_degree == 1],
        itertools.cycle(estimator.estimator_catalogue()),
    ),
    ("observer_free_third", None, "extended_state_observer"),
    ("prescribed_time", None, "kalman"),
    ("pid", None, "measured"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fmu")


def scenario(law, of_surface=None, velocity="measured", **more) -> smc.Scenario:
    common = {
        "duration": 0.1,
        "v0": 0.3,
        "reference": REFERENCE,
        "disturbance": smc.Sine(0.5, 7.0),
        "u_max": 20.0,
    }
    return smc.Scenario(
        plant="duffing",
        law=law,
        surface=of_surface,
        velocity=velocity,
        **common | more,
    )


@pytest.fixture(scope="module")
def combined(folder):
    """Combination -> its FMU, compiled without a warning, in a third of the time without
    optimisation, and its trace.
    """
    scenarios = [scenario(*combination) for combination in COMBINED]
    with ThreadPoolExecutor(2) as pool, pytest.MonkeyPatch.context() as patch:
        patch.setattr(build, "LIBRARY_FLAGS", ("-O0", *STRICT, *build.LIBRARY_FLAGS[1:]))
        paths = pool.map(
            lambda i: smc.exchange.law_to_fmu(scenarios[i], folder / f"{i}.fmu"),
            range(len(scenarios)),
        )
        return dict(zip(COMBINED, zip(list(paths), smc.run(scenarios), strict=True), strict=True))


@pytest.fixture(scope="module")
def twisting(folder):
    """The FMU of a law with memory, with a surface and an estimator with memory, and the folder of
    its files.
    """
    return smc.exchange.law_to_fmu(
        "super_twisting", folder / "twisting.fmu", surface="integral", velocity="levant", u_max=3.0
    ), folder / "twisting"


def seen(fmu: Importer, trace: smc.Trace, k: int) -> dict[str, float]:
    """The inputs of an FMU at a sample of a trace."""
    r, dr, ddr = type(REFERENCE).value(trace.t[k], REFERENCE)
    inputs = {
        "x": trace.x[k, 0],
        "v": trace.v[k, 0],
        "r": r,
        "dr": dr,
        "ddr": ddr,
    }
    return {name: value for name, value in inputs.items() if name in fmu.at}


def wave(k: int) -> dict[str, float]:
    """Inputs of an FMU without v, at a step."""
    return {
        "x": 0.3 * np.cos(0.05 * k),
        "r": 0.1,
        "dr": 0.0,
    }


# the same bits


@pytest.mark.parametrize("one", COMBINED, ids=lambda one: "-".join(map(str, one)))
def test_an_fmu_gives_the_bits_of_a_run(combined, folder, one):
    path, trace = combined[one]
    assert trace.failure is None
    assert validate_fmu(str(path)) == []
    fmu = Importer(path, folder / path.stem)
    stepped = np.array([fmu.step(t, **seen(fmu, trace, k)) for k, t in enumerate(trace.t)])
    assert fmu.said == []
    np.testing.assert_array_equal(stepped[:, 0], trace.u[:, 0])
    np.testing.assert_array_equal(stepped[:, 1], trace.s[:, 0])
    assert len(set(stepped[:, 1])) > 50
    assert ("v" in fmu.at) == (one[2] == "measured")


@pytest.mark.slow
def test_every_law_is_a_valid_fmu(folder):
    for name, template in law_catalogue().items():
        path = smc.exchange.law_to_fmu(template, folder / f"valid-{name}.fmu", binary=False)
        assert validate_fmu(str(path)) == []
        variables = {}
        for v in fmpy.read_model_description(str(path)).modelVariables:
            variables[v.name] = v
        for gain, about in template.gains.items():
            parameter = variables[f"law.{gain}"]
            assert parameter.causality == "parameter"
            assert parameter.variability == "tunable"
            assert float(parameter.start) == min(about.default, sys.float_info.max)
            assert (parameter.min is not None) == (about.positive or about.nonnegative)
        assert ("g" in variables) == template.requires_model, name


# instances


def test_instances_in_one_process_do_not_share_their_memory(twisting):
    alone = Importer(*twisting)
    expected = [alone.step(1e-3 * k, **wave(k)) for k in range(60)]
    first = Importer(*twisting)
    second = Importer(*twisting)
    outputs = []
    for k in range(60):
        outputs.append(first.step(1e-3 * k, **wave(k)))
        second.step(1e-3 * k, **wave(3 * k + 7))
    assert outputs == expected
    assert first.get("law.memory[1]", "estimator.memory[2]") != second.get(
        "law.memory[1]", "estimator.memory[2]"
    )


@pytest.mark.quick
def test_reset_forgets_everything(twisting):
    fmu = Importer(*twisting, law__k1=1.0)
    expected = []
    for k in range(40):
        expected.append(fmu.step(1e-3 * k, **wave(k)))
    fmu.set(law__k1=9.0, u_max=0.1)
    fmu.fmu.reset()
    start = [fmu.get(name)[0] for name in fmu.at]
    fresh = Importer(*twisting, begin=False)
    assert start == [fresh.get(name)[0] for name in fresh.at]
    fmu.begin(law__k1=1.0)
    assert [fmu.step(1e-3 * k, **wave(k)) for k in range(40)] == expected


def test_a_state_that_was_saved_is_come_back_to(twisting):
    fmu = Importer(*twisting)
    for k in range(20):
        fmu.step(1e-3 * k, **wave(k))
    saved = fmu.fmu.getFMUState()
    packed = fmu.fmu.serializeFMUState(saved)
    expected = [fmu.step(1e-3 * k, **wave(k)) for k in range(20, 50)]
    fmu.fmu.setFMUState(saved)
    assert [fmu.step(1e-3 * k, **wave(k)) for k in range(20, 50)] == expected
    restored = Importer(*twisting, begin=False)
    restored.fmu.setFMUState(restored.fmu.deserializeFMUState(packed))
    assert [restored.step(1e-3 * k, **wave(k)) for k in range(20, 50)] == expected
    fmu.fmu.freeFMUState(saved)


# parameters


def test_gains_are_in_their_order_and_change_while_it_runs(folder):
    law = smc.law("observer_free", lam=4.0, k1=2.0)
    path = smc.exchange.law_to_fmu(law, folder / "gains.fmu")
    fmu = Importer(path, folder / "gains")
    u, s = fmu.step(
        0.0,
        x=0.5,
        v=0.1,
        r=0.2,
        dr=0.05,
    )
    assert u == pytest.approx(-4.0 * np.tanh(0.05 + 2.0 * 0.3), rel=1e-15)
    assert s == 0.1 - 0.05 + 2.0 * (0.5 - 0.2)
    fmu.set(law__lam=1.0, law__k1=3.0)
    u, s = fmu.step(1e-3)
    assert u == pytest.approx(-np.tanh(0.05 + 3.0 * 0.3), rel=1e-15)
    assert s == 0.1 - 0.05 + 3.0 * (0.5 - 0.2)
    fmu.set(u_max=0.25)
    assert fmu.step(2e-3)[0] == -0.25
    fmu.set(u_max=sys.float_info.max)
    assert fmu.step(3e-3)[0] == u


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"law__k1": -1.0}, "law.k1 = -1 is out of its range"),
        ({"estimator__L": 0.0}, "estimator.L = 0 is out of its range"),
        ({"u_max": float("nan")}, "u_max = nan is out of its range"),
        ({"dt": 0.01}, "dt cannot be set now"),
        ({"u": 1.0}, "u cannot be set now"),
    ],
)
def test_a_value_out_of_its_range_is_refused_in_words(twisting, values, said):
    fmu = Importer(*twisting)
    with pytest.raises(Exception, match="fmi3SetFloat64"):
        fmu.set(**values)
    assert said in fmu.said[-1]


# time


def test_a_long_step_is_its_samples_and_a_short_one_holds(twisting):
    fine, long, short = (Importer(*twisting) for _ in range(3))
    x = {"x": 0.3, "r": 0.1, "dr": 0.0}
    expected = [fine.step(1e-3 * k, **x) for k in range(10)]
    assert long.step(0.0, 4e-3, **x) == expected[3]
    assert long.step(4e-3, 6e-3, **x) == expected[9]
    outputs = []
    for k in range(40):
        outputs.append(short.step(0.25e-3 * k, 0.25e-3, **x))
    assert outputs[::4] == outputs[3::4] == expected


def test_samples_are_counted_from_the_start_time(folder, combined):
    path, _ = combined["prescribed_time", None, "kalman"]
    early = Importer(path, folder / path.stem)
    late = Importer(path, folder / path.stem, start=100.0)
    for k in range(5):
        assert early.step(1e-3 * k, x=0.4) == late.step(100.0 + 1e-3 * k, x=0.4)
    assert late.get("time") == [pytest.approx(100.005)]


def test_with_event_mode_u_follows_x_without_a_step_between(twisting):
    """At each sample it has the bits of an instance without events after its step; stays held in
    between.
    """
    plain = Importer(*twisting)
    events = Importer(*twisting, events=True)
    expected = [plain.step(1e-3 * k, **wave(k)) for k in range(30)]
    for k in range(30):
        events.set(**wave(k))
        assert events.get("u", "s") == expected[k]  # before anything is completed
        assert events.get("u", "s") == expected[k]
        again, *_, defined, following = update(events)
        assert (again, defined) == (False, True)
        assert following == pytest.approx(1e-3 * (k + 1))
        events.set(**wave(k + 5))
        assert events.get("u", "s") == expected[k]  # the sample is over
        events.fmu.enterStepMode()
        assert events.fmu.doStep(1e-3 * k, 1e-3)[0]
        events.fmu.enterEventMode()


def test_an_importer_of_events_is_stopped_where_the_next_sample_is(twisting):
    fmu = Importer(*twisting, events=True, early=True)
    update(fmu)
    fmu.fmu.enterStepMode()
    needed, _, early, reached = fmu.fmu.doStep(0.0, 0.4e-3)
    assert (needed, early, reached) == (False, False, 0.4e-3)
    needed, _, early, reached = fmu.fmu.doStep(0.4e-3, 5e-3)
    assert (needed, early, reached) == (True, True, 1e-3)


def update(fmu: Importer) -> list:
    """The results of fmi3UpdateDiscreteStates."""
    return list(fmu.fmu.updateDiscreteStates())


def test_in_initialization_mode_u_is_that_of_the_first_sample(twisting):
    fmu = Importer(*twisting, begin=False)
    fmu.fmu.enterInitializationMode(startTime=0.0)
    fmu.set(**wave(0))
    first = fmu.get("u", "s")
    fmu.set(**wave(9))
    assert fmu.get("u", "s") != first
    fmu.set(**wave(0))
    fmu.fmu.exitInitializationMode()
    assert fmu.get("u", "s") == first  # seen, although no input of the start was looked at
    assert fmu.step(0.0) == first


# calls that are wrong


def test_calls_in_a_wrong_mode_are_refused(twisting):
    fmu = Importer(*twisting, begin=False)
    for call in (
        lambda: fmu.fmu.doStep(0.0, 1e-3),
        fmu.fmu.terminate,
        fmu.fmu.exitInitializationMode,
    ):
        with pytest.raises(Exception, match="fmi3"):
            call()
        assert "was called in the wrong mode" in fmu.said[-1]
    fmu.begin()
    with pytest.raises(Exception, match="fmi3EnterEventMode"):
        fmu.fmu.enterEventMode()
    for t, h, said in (
        (0.5, 1e-3, "the step begins at another time"),
        (0.0, 0.0, "is not positive"),
    ):
        with pytest.raises(Exception, match="fmi3DoStep"):
            fmu.fmu.doStep(t, h)
        assert said in fmu.said[-1]


def test_an_input_that_is_not_finite_ends_it_with_the_time(folder):
    path = smc.exchange.law_to_fmu("classical", folder / "far.fmu")
    fmu = Importer(path, folder / "far")
    fmu.step(0.0, x=0.1)
    fmu.set(x=float("inf"))
    with pytest.raises(Exception, match="fmi3DoStep"):
        fmu.fmu.doStep(1e-3, 1e-3)
    assert fmu.said[-1] == "the law gave u, s that are not finite, at t = 0.001 s"
    with pytest.raises(Exception, match="fmi3DoStep"):
        fmu.fmu.doStep(2e-3, 1e-3)
    fmu.fmu.reset()
    fmu.begin()
    fmu.step(0.0, x=0.1)


# description


def test_what_cannot_be_an_fmu_is_one_sentence(tmp_path, monkeypatch):
    for call, said in (
        (
            lambda: smc.exchange.law_to_fmu("passivity_based"),
            "is of many joints: give their number, such as joints=7",
        ),
        (
            lambda: smc.exchange.law_to_fmu(smc.law("classical", k=[1.0, 2.0])),
            "has gains by channel",
        ),
        (
            lambda: smc.exchange.law_to_fmu("pid", "law.zip"),
            "cannot save to 'law.zip': end the name in .fmu",
        ),
        (lambda: smc.exchange.law_to_fmu("pid", u_max=-1.0), "u_max is -1"),
        (lambda: smc.exchange.law_to_fmu("hierarchical", model="none"), "needs the nominal model"),
        (
            lambda: smc.exchange.law_to_fmu("twisting", surface="linear"),
            "surface 'linear' has relative degree 1, and law 'twisting' 2",
        ),
        (
            lambda: smc.exchange.law_to_fmu(scenario("pid"), surface="linear"),
            "a scenario has its own surface",
        ),
        (lambda: smc.exchange.law_to_fmu(smc.policy(lambda x: 0.0)), "cannot be written in C"),
    ):
        monkeypatch.chdir(tmp_path)
        with pytest.raises(smc.ScenarioError, match=said.replace("(", r"\(")) as error:
            call()
        assert "\n" not in str(error.value)
        assert list(tmp_path.iterdir()) == []


def test_without_room_for_temporary_files_there_is_one_sentence(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "gone"))
    with pytest.raises(
        smc.ScenarioError,
        match=r"no temporary file can be written \(.*\): make room, or set TMPDIR",
    ):
        smc.exchange.law_to_fmu("pid", "a.fmu")
