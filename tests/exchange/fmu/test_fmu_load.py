"""Controllers in FMUs as laws: those of this library come back with the same bits, and others' keep
their own steps.
"""

import gc
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest

fmpy = pytest.importorskip("fmpy", reason="FMPy, pip install 'smc-mujoco[fmu]', is not installed")

from exchange.helpers import fmu as helper  # noqa: E402
from exchange.helpers.compiler import needs_compiler  # noqa: E402

import smc_mujoco as smc  # noqa: E402
from smc_mujoco.control.law import Measurement  # noqa: E402
from smc_mujoco.exchange.fmu import law_from_fmu  # noqa: E402
from smc_mujoco.exchange.fmu.slave import Slave  # noqa: E402
from smc_mujoco.simulation.python_functions import gains_of  # noqa: E402

pytestmark = [
    needs_compiler,
    pytest.mark.filterwarnings("ignore::smc_mujoco.errors.PlainLoopWarning"),
]
FMI1 = (
    'fmiVersion="1.0" modelIdentifier="c" numberOfContinuousStates="0" numberOfEventIndicators="0"'
)
VARIABLES = {"x": "Plant.Theta", "v": "omega", "r": "setpoint"}
RENAMED = {
    "variables": VARIABLES,
    "constants": {"mode": 0.0},
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fmu")


@pytest.fixture(scope="module")
def foreign(folder):
    """An FMU of FMI 2.0 as another tool writes it, which steps every 10 ms."""
    return helper.fmi2(folder)


def scenario(law, plant="duffing", **more) -> smc.Scenario:
    common = {
        "duration": 0.1,
        "v0": 0.3,
        "noise": smc.Noise(0.003, 0.02),
        "reference": smc.Sine(0.2, 3.0),
    }
    return smc.Scenario(plant=plant, law=law, **common | more)


def test_samples_that_are_late_or_missed_are_steps_that_follow_each_other(folder, foreign):
    """The law's state waits for a missed sample, and an FMU of a longer period for the first sample
    that is due.
    """
    clock = {
        "clock": smc.Clock(jitter=5e-4, missed=0.3),
        "physics_step": 1e-4,
        "seed": 4,
    }
    ours = scenario("super_twisting", **clock)
    theirs = smc.exchange.law_from_fmu(smc.exchange.law_to_fmu(ours, folder / "late.fmu"))()
    first, second = smc.run([ours, scenario(theirs, **clock)])
    assert second.failure is None
    np.testing.assert_array_equal(second.u, first.u)
    slower = smc.run(
        scenario(smc.exchange.law_from_fmu(foreign, **RENAMED)(), u_max=100.0, **clock)
    )
    changed = np.flatnonzero(np.diff(slower.u[:, 0])) + 1
    assert slower.failure is None
    assert set(changed // 10) == set(range(1, 11))  # once in each 10 ms
    assert 0 < sum(changed % 10 > 0) < 6


def test_gains_are_the_fmu_s_parameters(folder):
    path = smc.exchange.law_to_fmu(
        smc.law("observer_free", lam=4.0, k1=2.0), folder / "gains.fmu", u_max=5.0
    )
    template = smc.exchange.law_from_fmu(path)
    assert template.defaults == {"u_max": 5.0, "law_lam": 4.0, "law_k1": 2.0}
    with pytest.raises(smc.ScenarioError, match="law_lam"):
        template(law_lam=-1.0)
    with pytest.raises(smc.ScenarioError, match="unknown gain of gains 'lam'"):
        template(lam=1.0)
    first, second = smc.run(
        [
            scenario(smc.law("observer_free", lam=3.0, k1=1.5)),
            scenario(template(law_lam=3.0, law_k1=1.5)),
        ]
    )
    np.testing.assert_array_equal(first.u, second.u)


def test_a_new_memory_starts_a_new_instance_and_the_old_ends_with_its_memory(folder):
    law = smc.exchange.law_from_fmu(
        smc.exchange.law_to_fmu("super_twisting", folder / "written_again.fmu")
    )()
    assert law.function is not None
    gc.collect()
    before = dict(law_from_fmu._running.by_number)
    y = Measurement(0.0, 1e-3, 0.5, 0.1, 0.5, 0.1, 0.0, 0.0, 0.0, 0.0, 1.0)
    gains = gains_of(law)
    memory = np.zeros(1)
    first, second = [law.function(y._replace(t=t), gains, memory) for t in (0.0, 1e-3)]
    assert first != second
    memory = np.zeros(1)
    assert law.function(y, gains, memory) == first
    assert len(law_from_fmu._running.by_number) == len(before) + 1
    del memory
    assert law_from_fmu._running.by_number == before


def test_another_process_takes_the_law_from_the_file(folder):
    path = smc.exchange.law_to_fmu("pid", folder / "sent.fmu")
    law = smc.exchange.law_from_fmu(path)()
    copy = pickle.loads(pickle.dumps(law))
    assert copy == law
    first, second = smc.run([scenario(law), scenario(copy)])
    np.testing.assert_array_equal(first.u, second.u)
    smc.exchange.law_to_fmu("classical", path)
    law_from_fmu.extracted.cache_clear()
    changed = smc.run(scenario(law))
    assert "FMU 'sent.fmu' is gone or has changed" in str(changed.failure)


# another tool's


def expected(trace: smc.Trace, k: float = 8.0) -> np.ndarray:
    """The commands of fmi2.c, from its equation, every tenth sample; `trace` has no noise."""
    u = []
    total = 0.0
    held = 0.0
    for i in range(len(trace.t)):
        if i % 10 == 0:
            e = trace.x[i, 0] - trace.r[i, 0]
            held = -k * e - 2.0 * trace.v[i, 0] - total
            total += 0.01 * e
        u.append(held)
    return np.array(u)


@pytest.mark.quick
def test_a_foreign_fmu_keeps_its_period_and_its_state(foreign):
    law = smc.exchange.law_from_fmu(foreign, **RENAMED)
    function = law.function
    assert isinstance(function, law_from_fmu.FmuLaw)
    assert dict(function.inputs) == {"x": "Plant.Theta", "v": "omega", "r": "setpoint"}
    assert function.outputs == ("torque",)
    assert function.period == 0.01
    trace, slower = smc.run(
        [
            scenario(law(), noise=None, u_max=100.0),
            scenario(law(gain_k=3.0), noise=None, u_max=100.0),
        ]
    )
    np.testing.assert_allclose(trace.u[:, 0], expected(trace), rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(slower.u[:, 0], expected(slower, 3.0), rtol=1e-14, atol=1e-14)
    assert len(set(trace.u[:, 0])) == 11
    assert (trace.s == 0.0).all()


def test_an_fmu_faster_than_the_law_steps_several_times_a_sample(foreign):
    law = smc.exchange.law_from_fmu(foreign, **RENAMED)()
    trace = smc.run(
        scenario(
            law,
            noise=None,
            u_max=100.0,
            control_period=0.02,
            physics_step=1e-3,
            duration=0.2,
        )
    )
    u = []
    total = 0.0
    for i in range(len(trace.t)):
        e = trace.x[i, 0] - trace.r[i, 0]
        u.append(-8.0 * e - 2.0 * trace.v[i, 0] - (total + 0.01 * e))  # the second of two steps
        total += 0.02 * e
    np.testing.assert_allclose(trace.u[:, 0], u, rtol=1e-13, atol=1e-13)


@pytest.mark.slow
def test_inputs_that_are_not_real_may_be_held(folder):
    """FMI 3.0: a Boolean and an Int32. It holds u for 5 samples."""
    path = helper.fmi3(folder)
    names = {"x": "sensor.phi", "v": "sensor.omega", "u": "motor.torque"}
    with pytest.raises(smc.ScenarioError, match="mean nothing that a law measures, enable, mode"):
        smc.exchange.law_from_fmu(path, variables=names)
    laws = []
    for on in (1, 0):
        laws.append(
            smc.exchange.law_from_fmu(path, variables=names, constants={"enable": on, "mode": 2})
        )
    trace, off = smc.run([scenario(law(), noise=None, u_max=100.0, reference=None) for law in laws])
    seen = slice(None, None, 5)
    total = 0.005 * np.cumsum(trace.x[seen, 0])
    u = -20.0 * trace.x[seen, 0] - 4.0 * trace.v[seen, 0] - total
    np.testing.assert_allclose(
        trace.u[:, 0], np.repeat(u, 5)[: len(trace.u)], rtol=1e-13, atol=1e-13
    )
    assert (off.u == 0.0).all()


def test_periods_that_do_not_fit_are_said(foreign):
    law = smc.exchange.law_from_fmu(foreign, **RENAMED)()
    trace = smc.run(scenario(law, duration=0.021, control_period=3e-3, physics_step=1e-3))
    assert (
        "the FMU steps every 0.01 s and the law runs every 0.003 s: give control_period=0.01"
        in str(trace.failure)
    )


def test_a_failing_step_of_an_fmu_ends_its_run_with_the_reason(foreign):
    law = smc.exchange.law_from_fmu(foreign, variables=VARIABLES, constants={"mode": 4.0})()
    trace, fine = smc.run([scenario(law), scenario("pid")])
    assert "the step from t = 0 s fails (the licence has ended)" in str(trace.failure)
    assert fine.failure is None


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (
            {},
            "controller.fmu has inputs that mean nothing that a law measures, mode: say which it "
            "is, "
            "variables={'x': 'mode'}, or hold each, constants={'mode': 0.0}",
        ),
        (
            {"constants": {"mod": 1.0}},
            "unknown input of controller.fmu 'mod': did you mean 'mode'?",
        ),
        (
            {"variables": {"x": "theta"}},
            "unknown input of controller.fmu 'theta': did you mean 'Plant.Theta'?",
        ),
        (
            {"variables": {"u": "omega"}},
            "unknown output of controller.fmu 'omega': choose from torque",
        ),
    ],
)
def test_a_mistake_in_the_call_is_one_sentence(foreign, settings, said):
    with pytest.raises(smc.ScenarioError) as error:
        smc.exchange.law_from_fmu(foreign, **{"variables": VARIABLES} | settings)
    assert str(error.value).startswith(said.replace("\\.", ".").replace("\\n", "\\n"))
    assert "\n" not in str(error.value)


def changed(foreign: Path, folder: Path, *pairs: tuple[str, str]) -> Path:
    """The foreign FMU with other words in its description."""
    about = (helper.HERE / "fmi2.xml").read_text()
    for old, new in pairs:
        assert old in about
        about = about.replace(old, new)
    path = folder / "changed.fmu"
    with zipfile.ZipFile(foreign) as old, zipfile.ZipFile(path, "w") as archive:
        for name in old.namelist():
            archive.writestr(name, about if name == "modelDescription.xml" else old.read(name))
    return path


@pytest.mark.parametrize(
    ("pair", "said"),
    [
        (("CoSimulation", "ModelExchange"), "changed.fmu is of FMI 2.0, or not for Co-Simulation"),
        (('fmiVersion="2.0"', FMI1), "changed.fmu is of FMI 1.0"),
        (("<fmiModelDescription", "<fmi"), "changed.fmu is not an FMU ("),
        (
            (
                'name="torque" valueReference="4" causality="output"',
                'name="torque" valueReference="4"',
            ),
            "changed.fmu has no output that is named as a command (none): say which it is",
        ),
        (
            (
                'name="torque"',
                'name="s" valueReference="9" causality="output"><Real/></ScalarVariable>'
                '<ScalarVariable name="kraft"',
            ),
            "changed.fmu has no output that is named as a command (s, kraft): "
            "say which it is, as in variables={'u': 'torque'}",
        ),
        (
            (
                'name="mode" valueReference="3" causality="input"><Real start="0"/>',
                'name="mode" valueReference="3" causality="input"><String start=""/>',
            ),
            "'mode' of changed.fmu is not one number: export it without this variable",
        ),
    ],
)
def test_an_fmu_that_cannot_be_a_law_is_one_sentence(foreign, tmp_path, pair, said):
    with pytest.raises(smc.ScenarioError) as error:
        smc.exchange.law_from_fmu(changed(foreign, tmp_path, pair), **RENAMED)
    assert str(error.value).startswith(said)
    assert "\n" not in str(error.value)


def test_an_fmu_for_another_machine_is_refused_by_its_machines(foreign, tmp_path):
    path = tmp_path / "windows.fmu"
    with zipfile.ZipFile(foreign) as old, zipfile.ZipFile(path, "w") as archive:
        for name in old.namelist():
            archive.writestr(name.replace(fmpy.platform, "win16"), old.read(name))
    with pytest.raises(
        smc.ScenarioError,
        match=r"windows\.fmu has a binary for win16, and this one is .*: export it for",
    ):
        smc.exchange.law_from_fmu(path)
    source = smc.exchange.law_to_fmu("pid", tmp_path / "source.fmu", binary=False)
    with pytest.raises(
        smc.ScenarioError,
        match=r"source\.fmu has a binary for no machine, .*, or compile its sources",
    ):
        smc.exchange.law_from_fmu(source)


def test_a_slave_says_which_variable_it_could_not_set(foreign, tmp_path):
    files = fmpy.extract(str(foreign), str(tmp_path / "files"))
    slave = Slave(files, ["Plant.Theta"], ["torque"], {"gain.k": 5.0, "mode": 0.0})
    assert slave.step([0.5], 0.0, 0.01) == [-2.5]
    with pytest.raises(Exception, match=r"the step from t = 0.01 s fails \(another step\)"):
        slave.step([0.5], 0.01, 0.02)
    slave.close()
