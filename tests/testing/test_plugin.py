"""The pytest plugin: what a user's tests on step responses say when they pass, fail, are recorded
and are mistaken.
"""

import contextlib
import importlib.metadata
import json
import math
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import smc_mujoco as smc
from smc_mujoco.common import gl, jit
from smc_mujoco.draw import figure as figures
from smc_mujoco.testing import golden
from smc_mujoco.testing.limits import bound
from smc_mujoco.testing.plugin import COMPILES
from smc_mujoco.testing.response import respond

ROOT = Path(__file__).parents[2]
INSTALLED = bool(importlib.metadata.entry_points(group="pytest11", name="smc_mujoco"))
PLUGIN = ("-p", "no:cacheprovider", *(() if INSTALLED else ("-p", "smc_mujoco.testing.plugin")))


# settles a step of 0.2 rad in 0.422 s, and with phi = 2 not at all
HEAD = """
import pytest
import smc_mujoco as smc

def pendulum(step_response, phi=0.3, **fields):
    law = smc.law("boundary_layer", k=6.0, c=8.0, phi=phi)
    return step_response("inverted_pendulum", law, step=0.2, **{"duration": 1.0} | fields)

"""
BAD = """
def test_it_settles(step_response):
    r = pendulum(step_response, phi=2.0)
    assert r.overshoot < 20
    assert r.settling_time < 0.6 and r.tv_rate < 10
"""


@pytest.fixture(scope="module", autouse=True)
def _warm():
    """What a session in this process would import is imported before it, for it is forgotten after
    it.
    """
    response = respond(
        "inverted_pendulum", smc.law("boundary_layer"), 0.2, "nominal", {"duration": 0.01}
    )
    assert response.max_u > 0


@pytest.fixture(autouse=True)
def at_a_terminal(monkeypatch):
    """pytest cuts its summary short there, and does not where CI is set."""
    monkeypatch.delenv("CI", raising=False)


@pytest.fixture
def undrawn(monkeypatch):
    """Figures cost half a second each; here only their names count."""
    monkeypatch.setattr(figures, "figure", lambda traces, path, title: path)


@pytest.fixture
def session(pytester, undrawn):
    """Run a test file, given as text, in a new folder; what pytest printed. outcomes: how many
    tests of each.
    """

    def run(text: str, *options: str, **outcomes: int) -> str:
        pytester.makepyfile(test_my_laws=HEAD + text)
        done = pytester.runpytest_inprocess(*PLUGIN, *options)
        done.assert_outcomes(**outcomes)
        return done.stdout.str()

    return run


# the first test on a computer


def test_the_first_test_says_why_it_is_slow_only_where_nothing_is_compiled(
    session, monkeypatch, tmp_path
):
    monkeypatch.setattr(jit, "cache_folder", lambda: tmp_path)
    text = "def test_a(step_response): pass\ndef test_b(step_response): pass"
    assert session(text, passed=2).count(COMPILES) == 1
    tmp_path.joinpath("law.code").touch()
    assert COMPILES not in session(text, passed=2)


# pass and fail


def test_a_bad_law_fails_with_a_line_of_its_first_metrics(session):
    said = session(BAD, failed=1)
    assert re.search(r"^settling_time never, overshoot \d+\.\d+ %, tv_rate \S+ N m/s$", said, re.M)
    assert "all metrics: pytest -v" in said
    assert "steady_error" not in said


@pytest.mark.quick
def test_a_bad_law_fails_with_a_table_of_its_metrics_where_more_is_asked_for(session):
    said = session(BAD, "-v", failed=1)
    assert "all metrics" not in said
    assert "assert (inf < 0.6" in said
    assert "inverted_pendulum under boundary_layer(k=6, c=8, phi=2), step 0.2 rad" in said
    rows = {}
    for line in said.splitlines():
        if re.match(r"\w+ {2,}\S", line):
            rows[line.split()[0]] = re.split(r"  +", line)
    assert rows["metric"] == ["metric", "value"]
    assert rows["settling_time"] == ["settling_time", "never"]
    assert rows["steady_error"][1].endswith(" rad")
    assert "tv_rate" in rows
    assert "stick_time" not in rows  # no friction, nothing sticks


@pytest.mark.parametrize(
    ("value", "kept"),
    [
        (0.9, False),
        (1.0, True),
        (2.0, True),
        (2.1, False),
    ],
)
def test_a_pair_of_limits_holds_from_both_sides(value, kept):
    check = bound("overshoot", value, "%", (1.0, 2.0))
    assert check.within == kept
    assert check.limit == "1 .. 2"
    assert bound("driven chattering_amplitude", math.nan, "rad", 0.0).within  # no limit cycle
    assert bound("overshoot", value, "%", 2.0).within == (value <= 2.0)
    assert bound("overshoot", value, "%", 1.9).within == (value < 1.9)


def test_the_frames_of_this_package_stay_out_of_a_failure(session):
    said = session(
        """
def test_check(step_response): pendulum(step_response, phi=2).check(settling_time=1)
def test_plant(step_response): step_response("duffin", "classical", step=0.2)
def test_metric(step_response): pendulum(step_response).check(setling_time=1)
def test_limit(step_response): pendulum(step_response).check(settling_time="1 s")
def test_failed(step_response): pendulum(step_response, mismatch={"mass": 1e-9}).settling_time
""",
        failed=5,
    )
    assert set(re.findall(r"^(\S+\.py):\d+: ", said, re.MULTILINE)) == {"test_my_laws.py"}
    assert len(re.findall(r"^E +smc_mujoco.common.errors.ScenarioError: ", said, re.MULTILINE)) == 4


def test_a_run_that_fails_says_why(session):
    said = session(
        "def test(step_response): pendulum(step_response, "
        "mismatch={'mass': 1e-9}).check(overshoot=5)",
        failed=1,
    )
    assert re.search(
        r"^E +AssertionError: inverted_pendulum under .*: the plant diverged", said, re.MULTILINE
    )
    assert "failed: the plant diverged" in said


def test_a_report_has_the_responses_of_wider_fixtures(session):
    said = session(
        """
@pytest.fixture(scope="module")
def r(step_response): return pendulum(step_response)
def test_first(r): assert r.settling_time < 0.6
def test_second(r): assert r.overshoot < 0.1
""",
        failed=1,
        passed=1,
    )
    assert re.search(r"^E +assert 1\.5\d* < 0\.1$", said, re.MULTILINE)
    assert len(re.findall(r"^settling_time 0\.42\d* s, ", said, re.MULTILINE)) == 1


def test_a_mistake_is_one_sentence(step_response, refused):
    for call, word in [
        ("'duffing', 'clasical', step=1", "'clasical'"),
        ("'duffing', 'classical', step=0", "step is 0"),
        ("'duffing', 'classical', step='1'", "step is '1'"),
        ("'duffing', 'classical', step=1, frction=1", "'frction'"),
        ("'duffing', 'classical', step=1, condition='noisy'", "'noisy'"),
        ("'cart_pole', 'none', step=1, condition='jump_mild'", "'jump_mild'"),
        ("'duffing', 'classical', step=1, reference=smc.Step(2)", "reference"),
        ("'duffing', lambda y, g, m: (0.0, 0.0), step=1", "law_function"),
    ]:
        refused(
            lambda call=call: eval(
                f"step_response({call})", {"smc": smc, "step_response": step_response}
            ),
            word,
        )


# what a response is


def test_a_response_starts_at_rest_at_zero_and_has_every_metric(step_response):
    r = step_response("pendulum_network", "super_twisting", step=0.3, duration=0.05)
    assert (r.trace.x[0] == 0).all()
    assert (r.trace.v[0] == 0).all()
    assert (r.trace.r == 0.3).all()
    assert {name: float(value) for name, value in r.metrics.items()} == smc.score(r.trace)
    for name, value in r.metrics.items():
        assert getattr(r, name) is value
    assert set(r.metrics) <= set(dir(r))
    with pytest.raises(AttributeError, match="unknown metric 'overshot': did you mean 'overshoot'"):
        r.overshot  # noqa: B018
    assert "\n" not in repr(r)


@pytest.fixture
def pole(step_response):
    return step_response("cart_pole", "hierarchical", step=0.3, model="nominal", duration=1.0)


def test_a_pole_on_a_cart_has_its_own_metrics_in_its_own_unit(pole):
    assert (pole.trace.r == [0.3, 0.0]).all()
    assert {name: float(value) for name, value in pole.scores["free"].items()} == smc.scores(
        pole.trace
    )["free"]
    assert pole.metrics.keys() == pole.scores["driven"].keys() == smc.score(pole.trace).keys()
    assert pole.scores["free"]["peak"] > 1e-4
    with pytest.raises(
        AttributeError, match="spread_bound compares channels and cart_pole has one of a kind"
    ):
        pole.spread_bound  # noqa: B018


def test_check_takes_metrics_of_a_group_by_its_name(pole, refused):
    pole.check(**{"free peak": 1.0, "free settling_time": 1.0})
    with pytest.raises(AssertionError, match=r"^free peak is .* rad, not"):
        pole.check(**{"free peak": 1e-6})
    refused(lambda: pole.check(**{"free max_u": 1.0}), "'free max_u'")


# figure and film


@pytest.mark.slow
def test_a_failing_test_attaches_its_figure_and_with_smc_film_its_film(pytester, monkeypatch):
    pytester.makepyfile(test_my_laws=HEAD + BAD.replace("phi=2.0", "phi=2.0, duration=0.04"))
    pytester.makeconftest("""
        import functools
        import smc_mujoco.draw.film.film as film
        film.film = functools.partial(film.film, size=(320, 180))  # pixels take most of the time
    """)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), *sys.path]))
    # in a separate process: a renderer that this one forgets would be opened twice
    said = pytester.runpytest_subprocess(*PLUGIN, "--smc-film").stdout.str()
    (figure,) = re.findall(r"^figure: (.*)$", said, re.MULTILINE)
    assert Path(figure).read_bytes().startswith(b"\x89PNG")
    assert "smc_mujoco" in Path(figure).parts  # a folder in pytest's temporary one
    films = re.findall(r"^film: (.*)$", said, re.MULTILINE)
    assert len(films) == (gl.missing_renderer() is None)
    for film in films:
        assert Path(film).stat().st_size > 1000
    assert list(pytester.path.glob("*.png")) == []


def test_a_figure_that_cannot_be_drawn_hides_nothing(session, monkeypatch):
    monkeypatch.setattr(figures, "figure", lambda traces, path, title: 1 / 0)
    said = session(BAD, failed=1)
    assert re.findall(r"^(?:no )?figure.*$", said, re.MULTILINE) == ["no figure: division by zero"]
    assert "assert (inf < 0.6" in said


# golden metrics

GOLDEN = """
def test_as_ever(step_response, smc_golden):
    r = pendulum(step_response, phi=PHI)
    smc_golden(r, settling_time=0.001, overshoot=0.5)
    smc_golden(r)
"""


def test_golden_metrics_are_asked_for_recorded_and_compared(session, pytester):
    good = GOLDEN.replace("PHI", "0.3")
    regolden = GOLDEN.replace("PHI", "0.35")
    said = session(good, failed=1)
    assert "has no golden settling_time, overshoot of test_as_ever: run pytest --smc-up" in said
    said = session(good, "--smc-update", passed=1)
    assert f"golden metrics recorded in {pytester.path / 'test_my_laws.golden.json'}" in said
    session(good, passed=1)
    said = session(regolden, failed=1)
    assert set(re.findall(r"^(\S+\.py):\d+: ", said, re.MULTILINE)) == {"test_my_laws.py"}
    assert re.search(
        r"^E +AssertionError: settling_time is 0\.\d+ s, golden 0\.422 ± 0\.001$",
        said,
        re.MULTILINE,
    )
    assert re.search(r"^E +next +if it is meant, run pytest --smc-update$", said, re.MULTILINE)
    assert re.search(r"^E +holds +overshoot 1\.\d+ %, 1\.\d+ ± 0\.5$", said, re.MULTILINE)
    session(regolden, "--smc-update", passed=1)
    session(regolden, passed=1)


def test_a_golden_file_is_plain_and_holds_each_call(session, pytester):
    session(GOLDEN.replace("PHI", "2.0"), "--smc-update", passed=1)
    held = json.loads(
        (pytester.path / "test_my_laws.golden.json").read_text(), parse_constant=pytest.fail
    )
    assert list(held) == ["test_as_ever", "test_as_ever 2"]
    assert held["test_as_ever"]["settling_time"] == {
        "value": "Infinity",
        "tolerance": 0.001,
        "unit": "s",
    }
    assert len(held["test_as_ever 2"]) > 10
    assert "stick_time" not in held["test_as_ever 2"]
    session(GOLDEN.replace("PHI", "2.0"), passed=1)  # "never" is as golden as a number


def test_a_broken_golden_file_is_one_sentence(tmp_path, refused):
    metric = '{{"test": {{"overshoot": {{"value": 1, {} "unit": "%"}}}}}}'
    tolerances = ['"tolerance": Infinity,', '"tolerance": NaN,', '"tolerance": -1,']
    twice = '"tolerance": 1, "value": 2,'
    for text in ["{", "[]", '{"test": 3}', *map(metric.format, [*tolerances, twice])]:
        (tmp_path / "a.json").write_text(text)
        refused(lambda: golden.read_golden(tmp_path / "a.json"), "a.json", "--smc-update")


@pytest.mark.parametrize(
    ("recorded", "of_file", "of_test", "off"),
    [
        (0.0, 0.0, {}, False),
        (0.5, 0.5, {}, False),  # the tolerance itself is within
        (0.5, 0.4375, {}, True),
        (-0.5, 0.5, {}, False),
        (-0.5, 0.4375, {}, True),
        (0.5, 0.0, {"overshoot": 0.5}, False),  # that of the test counts
        (0.5, 9.0, {"overshoot": 0.4375}, True),
        (math.nan, 9.0, {}, True),
        (math.inf, 9.0, {}, True),
    ],
)
def test_a_golden_metric_is_within_its_tolerance_or_off(
    step_response, tmp_path, recorded, of_file, of_test, off
):
    response = step_response("duffing", "none", step=0.1, duration=0.01)
    assert response.overshoot == 0
    file = tmp_path / "a.json"
    golden.record(file, "test", response, {"overshoot": of_file})
    stored = json.loads(file.read_text())
    stored["test"]["overshoot"]["value"] = str(recorded)
    file.write_text(json.dumps(stored))
    if off:
        said = pytest.raises(AssertionError, match=r"^overshoot is 0 %")
    else:
        said = None
    with said or contextlib.nullcontext():
        golden.compare_with_record(file, "test", response, of_test)


def test_a_golden_metric_in_another_unit_is_refused(step_response, tmp_path, refused):
    response = step_response("duffing", "none", step=0.1, duration=0.01)
    file = tmp_path / "a.json"
    golden.record(file, "test", response, {"peak": 1.0})
    file.write_text(file.read_text().replace('"unit": "m"', '"unit": "mm"'))
    refused(lambda: golden.compare_with_record(file, "test", response, {}), "'mm'", "--smc-update")


def test_a_value_of_0_is_recorded_with_a_tolerance_above_rounding(step_response, tmp_path):
    response = step_response("duffing", "none", step=0.1, duration=0.01)
    golden.record(tmp_path / "a.json", "test", response, {})
    stored = golden.read_golden(tmp_path / "a.json")["test"]
    assert stored["overshoot"]["tolerance"] == golden.MIN_TOLERANCE
    assert stored["peak"]["tolerance"] == (
        pytest.approx(0.01 * response.peak, rel=0.05) if response.peak else golden.MIN_TOLERANCE
    )


@pytest.mark.skipif(sys.platform == "win32", reason="no lock there")
def test_tests_that_record_at_once_lose_nothing(step_response, tmp_path):
    response = step_response("duffing", "none", step=0.1, duration=0.01)
    assert response.overshoot == 0

    def put(test: int) -> None:
        golden.record(tmp_path / "a.json", f"test {test}", response, {"overshoot": 1.0})

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(put, range(40)))
    assert len(json.loads((tmp_path / "a.json").read_text())) == 40


# the marker


def test_the_marker_makes_a_test_for_each_plant_and_condition(session):
    said = session(
        """
@pytest.mark.smc(plants=["duffing", "van_der_pol"], conditions=["nominal", "noise"])
def test_both(step_response, plant, condition):
    r = step_response(plant, "none", step=0.1, condition=condition, duration=0.01)
    assert (r.scenario.plant.name, bool(r.scenario.noise.position)) == (plant, condition == "noise")

@pytest.mark.smc
def test_all(plant): assert plant in smc.paper.GAINS

@pytest.mark.smc(conditions="sine")
def test_one(condition): assert condition == "sine"

def test_with_a_plant_of_its_own(plant): assert plant == 3

@pytest.fixture
def plant(): return 3
""",
        "-rA",
        "--strict-markers",
        passed=4 + len(smc.paper.GAINS) + 2,
    )
    assert "test_both[duffing-noise]" in said or "test_both[noise-duffing]" in said


@pytest.mark.parametrize(
    ("marker", "arguments", "words"),
    [
        ("plants=['dufing']", "plant", "unknown plant 'dufing': did you mean 'duffing'?"),
        ("plant=['duffing']", "plant", "unknown argument of marker smc 'plant'"),
        ("plants=[]", "plant", "plants of marker smc is []"),
        ("['duffing']", "plant", "marker smc is given ['duffing']"),
        ("plants=['duffing']", "condition", "gives plants and the test takes no plant"),
        ("", "", "on a test that takes neither plant nor condition"),
    ],
)
def test_a_wrong_marker_is_one_sentence(session, marker, arguments, words):
    said = session(f"@pytest.mark.smc({marker})\ndef test_it({arguments}): pass", errors=1)
    assert words in said
    assert "Traceback" not in said
    assert "raise " not in said


# what it costs who does not use it

UNUSED = """
import os, sys
def test_nothing_is_loaded():
    assert not {"numpy", "mujoco", "numba", "matplotlib"} & set(sys.modules)
    assert "MUJOCO_GL" not in os.environ
def test_used_it_leaves_the_renderer_to_mujoco():
    import smc_mujoco
    assert smc_mujoco.plant("duffing").n == 1
    assert "mujoco" in sys.modules
    assert "MUJOCO_GL" not in os.environ
"""


def test_plugin_imports_nothing_heavy_and_never_sets_mujoco_gl(tmp_path):
    (tmp_path / "test_user.py").write_text(UNUSED)
    clean = {}
    for k, v in os.environ.items():
        if not k.startswith(("PYTEST", "MUJOCO_GL")):
            clean[k] = v
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", *PLUGIN, "test_user.py"],
        cwd=tmp_path,
        env=clean | {"PYTHONPATH": str(ROOT), "COLUMNS": "100"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert {path.name for path in tmp_path.iterdir()} - {"__pycache__"} == {"test_user.py"}


def test_a_value_that_misses_by_little_is_printed_with_its_digits():
    assert bound("overshoot", 5.0001, "%", 5.0).value == "5.0001 %"
    assert bound("overshoot", 5.1234, "%", 5.0).value == "5.12 %"
