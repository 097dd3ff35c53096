"""The pytest plugin: tests on the step responses of control laws.

    def test_my_law_settles(step_response):
        r = step_response("inverted_pendulum", my_law, step=0.2, friction=smc.Coulomb(0.05))
        assert r.settling_time < 0.6 and r.overshoot < 5 and r.tv_rate < 10

pytest loads this file in every session if the package is installed (entry point `pytest11`). So it
imports nothing heavy until a test uses a fixture or the marker, and does not change MUJOCO_GL.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Generator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import pytest

if TYPE_CHECKING:
    from smc_mujoco.testing.response import StepResponse

__tracebackhide__ = True  # pytest hides the frames of a module that has it
EXAMPLE = '@pytest.mark.smc(plants=["duffing"], conditions=["nominal", "noise"])'
COMPILES = "smc_mujoco compiles its code, once on a computer, so the first test is slow"
GOLDEN = "smc_golden"  # property of a test's report: the golden file that it wrote


class Ledger(NamedTuple):
    """The running test's responses, and pytest's temporary folder: written by fixtures, read by
    hooks.
    """

    responses: list[StepResponse]
    temporary: Path


LEDGER = pytest.StashKey[Ledger]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of this plugin."""
    group = parser.getgroup("smc_mujoco", "step responses of control laws (smc_mujoco)")
    group.addoption(
        "--smc-update",
        action="store_true",
        help="record golden metrics instead of comparing with them",
    )
    group.addoption(
        "--smc-film", action="store_true", help="film the step responses of failing tests too"
    )
    group.addoption(
        "--smc-out", metavar="DIR", help="folder for figures and films; default: a temporary one"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker."""
    config.addinivalue_line(
        "markers",
        "smc(plants=[...], conditions=[...]): run the test with each plant and condition of "
        "smc_mujoco's study, as its arguments `plant` and `condition`.",
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run a test once for each plant and condition of the marker."""
    marker = metafunc.definition.get_closest_marker("smc")
    if marker is None:
        return
    from smc_mujoco.common.errors import ScenarioError

    wrong = ""
    names_of: dict[str, list[str]] = {}
    try:
        names_of = _cases(marker.args, marker.kwargs, metafunc.fixturenames)
    except ScenarioError as error:
        wrong = str(error)
    if wrong:  # raised outside of the handler, so that pytest does not show the frames of the error
        pytest.fail(f"{metafunc.definition.nodeid}: {wrong}", pytrace=False)
    for argument, names in names_of.items():
        metafunc.parametrize(argument, names)


def _cases(
    given: Sequence[object], named: Mapping[str, object], arguments: Collection[str]
) -> dict[str, list[str]]:
    """Return the test's argument, "plant" or "condition" -> the names with which the test runs."""
    from smc_mujoco.common.errors import ScenarioError, find, shown
    from smc_mujoco.mechanisms.plant import plant_catalogue
    from smc_mujoco.simulation.conditions import PLANTS, find_condition

    defaults = {"plants": PLANTS, "conditions": ("nominal",)}
    name_of = {
        "plant": lambda item: find("plant", item, plant_catalogue()).name,
        "condition": lambda item: str(find_condition(item)),
    }
    if given:
        raise ScenarioError(
            f"marker smc is given {shown(given[0])}: name its arguments, as in {EXAMPLE}"
        )
    for name in named:
        find("argument of marker smc", name, defaults)
    used: dict[str, list[str]] = {}
    for plural, default in defaults.items():
        argument = plural.removesuffix("s")
        value = named.get(plural, default)
        values = value if isinstance(value, list | tuple) else [value]
        if argument in arguments:
            if not values:
                raise ScenarioError(
                    f"{plural} of marker smc is {shown(value)}: give names, as in {EXAMPLE}"
                )
            used[argument] = [name_of[argument](item) for item in values]
        elif plural in named:
            raise ScenarioError(
                f"marker smc gives {plural} and the test takes no {argument}: add the argument"
            )
    if not used:
        raise ScenarioError(
            "marker smc is on a test that takes neither plant nor condition: add the arguments"
        )
    return used


@pytest.fixture(scope="session")
def step_response(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Callable[..., StepResponse]:
    """Run a law from rest to a step of the reference: step_response(plant, law, step, condition,
    **scenario fields).

    Example: r = step_response("duffing", my_law(k1=4.0), step=0.2, condition="noise", duration=5.0)
    Every metric is an attribute: assert r.settling_time < 2. r.check(settling_time=2, overshoot=5)
    tests several.
    """
    from smc_mujoco.testing.limits import without_frames
    from smc_mujoco.testing.response import respond

    ledger = request.config.stash.setdefault(LEDGER, Ledger([], tmp_path_factory.getbasetemp()))
    _tell_of_compiling(request.config)

    @without_frames
    def run(plant, law, step, condition="nominal", **fields) -> StepResponse:
        ledger.responses.append(respond(plant, law, step, condition, fields))
        return ledger.responses[-1]

    return run


def _tell_of_compiling(config: pytest.Config) -> None:
    """Print why the first test is slow, where nothing is compiled yet."""
    from smc_mujoco.common.jit import cache_folder

    reporter = config.pluginmanager.get_plugin("terminalreporter")
    capture = config.pluginmanager.get_plugin("capturemanager")
    if not (reporter and capture) or any(cache_folder().glob("*.code")):
        return
    with capture.global_and_fixture_disabled():
        reporter.write_line(COMPILES)


@pytest.fixture
def smc_golden(request: pytest.FixtureRequest) -> Callable[..., None]:
    """Compare a response with the metrics that `pytest --smc-update` recorded: smc_golden(r,
    settling_time=0.01).

    Named metrics are compared within a tolerance in their unit. If none is named, all metrics are
    compared, within 1 % of their recorded value.
    """
    from smc_mujoco.testing import golden as files
    from smc_mujoco.testing.limits import without_frames

    file = request.path.with_suffix(".golden.json")
    update = request.config.getoption("smc_update")
    test = request.node.nodeid.partition("::")[2]
    number = itertools.count(1)

    @without_frames
    def compare(response: StepResponse, **tolerances: float) -> None:
        n = next(number)
        key = test if n == 1 else f"{test} {n}"
        if update:
            files.record(file, key, response, tolerances)
            request.node.user_properties.append((GOLDEN, str(file)))
        else:
            files.compare_with_record(file, key, response, tolerances)

    return compare


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Forget the responses of the previous test."""
    if ledger := item.config.stash.get(LEDGER, None):
        ledger.responses.clear()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add the step responses of a failing test to its report."""
    report = yield
    ledger = item.config.stash.get(LEDGER, None)
    if ledger and report.failed and call.when != "teardown" and (responses := _used(item, ledger)):
        from smc_mujoco.testing.response import report_of

        folder = ledger.temporary / "smc_mujoco"
        if out := item.config.getoption("smc_out"):
            folder = item.config.invocation_params.dir / out
        film = bool(item.config.getoption("smc_film"))
        full = item.config.get_verbosity() > 0
        text = report_of(item.nodeid, responses, folder, video=film, full=full)
        report.sections.append(("step responses", text))
    return report


def _used(item: pytest.Item, ledger: Ledger) -> list[StepResponse]:
    """Return the responses that a test made, and those from fixtures of a wider scope."""
    from smc_mujoco.testing.response import StepResponse

    candidates = [*getattr(item, "funcargs", {}).values(), *ledger.responses]
    used = {}
    for value in candidates:
        if isinstance(value, StepResponse):
            used[id(value)] = value
    return list(used.values())


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Print which golden files were written."""
    if config.getoption("smc_update"):
        files = set()
        for report in itertools.chain.from_iterable(terminalreporter.stats.values()):
            for name, value in getattr(report, "user_properties", ()):
                if name == GOLDEN:
                    files.add(value)
        for file in sorted(files):
            terminalreporter.write_line(f"golden metrics recorded in {file}")
