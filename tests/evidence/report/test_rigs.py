"""The report's section on real machines: rankings over parameter sets, and records beside their
twins.
"""

from pathlib import Path

import numpy as np
import pytest

import smc_mujoco as smc
from smc_mujoco.evidence.report import charts, rigs, stages
from smc_mujoco.evidence.report.plan import Bars, Work
from smc_mujoco.evidence.rigs import records
from tests.evidence.report.test_report import TINY

DATA = Path(smc.__file__).resolve().parents[2] / "shared" / "rigs"
AXIS = smc.rig("emps")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A record of the simulated axis, one that it cannot have written, and a file of other columns."""
    path = tmp_path_factory.mktemp("records")
    trace = smc.run(AXIS.scenario(duration=0.4, reference=smc.Sine(0.05, 8.0), x0=0.0))
    record = records.of_trace(trace, AXIS.columns)
    np.savez(path / "run.npz", **record)
    np.savez(path / "slow.npz", **{name: values[::2] for name, values in record.items()})
    (path / "other.csv").write_text("a,b\n1,2\n")
    return path


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    return Work(plan=TINY, folder=tmp_path_factory.mktemp("report"), threads=None, bars=Bars(False))


@pytest.fixture(scope="module")
def shown(folder, work):
    return rigs.repeated(work, folder)


def test_records_find_the_twin_of_their_columns(shown):
    assert [(each.name, each.rig.name) for each in shown] == [
        ("run.npz", "emps"),
        ("slow.npz", "emps"),
    ]
    own = shown[0].fits["the twin’s"]
    assert min(own.values()) > 90.0  # the velocity at the start is read off the positions
    assert shown[0].why == ""
    assert "sampled every 0.002 s" in shown[1].why


def test_a_picture_has_what_was_measured_beside_the_twin(shown, monkeypatch):
    given = []
    monkeypatch.setattr(
        charts,
        "residual_figure",
        lambda *those: given.extend(those) or those[-1].write_bytes(b"svg"),
    )
    assert charts.record(shown[0]) == b"svg"
    title, t, measured, predicted, fits, units, _ = given
    assert title == "emps: run.npz"
    assert len(t) == len(measured["x"]) == len(predicted["twin"]["u"]) <= rigs.MAX_CURVE_POINTS
    assert t[-1] == pytest.approx(0.4, abs=1e-3)
    assert (fits["twin"], units) == (shown[0].fits["the twin’s"], AXIS.units)


def test_a_folder_without_records_of_a_rig_is_refused_before_any_run(work, tmp_path):
    (tmp_path / "a.csv").write_text("a,b\n1,2\n")
    with pytest.raises(
        smc.ScenarioError,
        match="has the columns of a rig: give those of one of emps t, x, u, r; qub",
    ):
        stages.find(TINY, work.folder / "none", None, Bars(False), tmp_path)
    assert not (work.folder / "none").exists()
    with pytest.raises(smc.ScenarioError, match="no folder at"):
        rigs.read(tmp_path / "b")


def test_every_law_of_the_machine_runs_on_every_set(work):
    (machine,) = rigs.machines(work)
    qube = smc.rig("qube_servo")
    assert list(machine.laws) == [law.name for law in qube.laws]
    assert machine.laws["state_feedback"] == "Rig's state feedback"
    assert len(set(machine.colours.values())) == len(qube.laws)
    for board in machine.boards:
        assert [block.condition for block in board.blocks] == list(qube.members())
        assert len(machine.medians(board.metric, "relay")) == len(qube.members())
    assert machine.unit("tv_rate") == "V/s"
    assert machine.unit("itae") == "rad s^2"
