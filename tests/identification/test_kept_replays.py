"""A search that was stopped goes on from what it simulated, and ends where it would have ended."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from helpers.machine_logs import chain, log, sines
from typer.testing import CliRunner

import smc_mujoco as smc
from smc_mujoco.cli.main import app
from smc_mujoco.identification.replays import Replays

ONE = chain([0.4], [1.0])
TRUTH = {"j1.damping": 0.3, "j1.armature": 0.02}


class Stop:
    """What stops the batch of replays that has a number, and counts those that are simulated."""

    def __init__(self, monkeypatch):
        self.simulated = 0
        self.before = 0
        simulate = Replays._simulated

        def batch(replays, *of):
            self.simulated += 1
            if self.simulated == self.before:
                raise KeyboardInterrupt
            return simulate(replays, *of)

        monkeypatch.setattr(Replays, "_simulated", batch)

    def reset(self, before=0):
        self.simulated, self.before = 0, before


@pytest.fixture
def stop(monkeypatch):
    return Stop(monkeypatch)


@pytest.fixture(scope="module")
def run():
    return log(ONE, TRUTH, sines([0.0], [0.5, 0.3], [0.4, 2.7]), 20.0, 1.5, duration=1.5)


def test_a_stopped_search_goes_on_and_gives_the_same_bits(run, stop, tmp_path):
    arm = smc.plant_from(ONE, ["j1"])
    uninterrupted = smc.identify(arm, run, list(TRUTH), held_out=run)
    folder = tmp_path / "replays"
    stop.reset()
    smc.identify(arm, run, list(TRUTH), held_out=run, folder=folder)
    count = stop.simulated
    for part in (1, 2):
        stop.reset(before=count // 3)
        with pytest.raises(KeyboardInterrupt):
            smc.identify(arm, run, list(TRUTH), held_out=run, folder=folder)
        assert len(list(folder.iterdir())) == part * (count // 3 - 1)
    damaged, *_ = folder.iterdir()
    damaged.write_bytes(damaged.read_bytes()[:100])
    stop.reset()
    again = smc.identify(arm, run, list(TRUTH), held_out=run, folder=folder)
    assert stop.simulated == count - 2 * (count // 3 - 1) + 1
    assert not folder.exists()
    for field in ("values", "errors", "fits", "by_pieces", "held_out", "notes", "evaluations"):
        assert getattr(again, field) == getattr(uninterrupted, field), field


@pytest.mark.slow
def test_what_was_simulated_of_another_log_or_machine_is_not_taken(run, stop, tmp_path):
    arm = smc.plant_from(ONE, ["j1"])
    folder = tmp_path / "replays"
    stop.reset(before=4)
    with pytest.raises(KeyboardInterrupt):
        smc.identify(arm, run, ["j1.damping"], folder=folder)
    later = {name: values + (0.01 if name == "x" else 0.0) for name, values in run.items()}
    heavy = smc.plant_from(chain([0.4], [1.1]), ["j1"])
    for machine, columns in ((arm, later), (heavy, run)):
        stop.reset()
        fresh = smc.identify(machine, columns, ["j1.damping"], folder=tmp_path / "fresh")
        count = stop.simulated
        stop.reset()
        copied = tmp_path / "other"
        shutil.copytree(folder, copied)
        beside = smc.identify(machine, columns, ["j1.damping"], folder=copied)
        assert beside.values == fresh.values
        assert stop.simulated == count


@pytest.mark.slow
def test_the_command_keeps_them_beside_its_report(run, stop, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("arm.xml").write_text(ONE)
    rows = np.column_stack([*run.values()])
    np.savetxt("run.csv", rows, delimiter=",", header=",".join(run), comments="")
    command = ["identify", "arm.xml", "run.csv", "--for", "j1.damping"]
    stop.reset(before=5)
    stopped = CliRunner().invoke(app, command)
    assert isinstance(stopped.exception, KeyboardInterrupt) or stopped.exit_code == 130
    assert len(list(Path("fit/replays").iterdir())) == 4
    stop.reset()
    assert CliRunner().invoke(app, command).exit_code == 0
    assert not Path("fit/replays").exists()
    assert Path("fit/report.html").exists()
