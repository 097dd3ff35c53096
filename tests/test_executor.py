"""Where runs are computed makes no difference to what a study finds."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import smc_mujoco as smc
from smc_mujoco import cluster, executor, paper
from smc_mujoco.grids import grid
from smc_mujoco.study import study

ROOT = Path(__file__).parents[1]


def mixed() -> list[smc.Scenario]:
    return grid(["duffing", "pendulum_network"], ["classical", "none"], ["nominal", "coulomb"], 3, "study", 0.05)


@smc.law_function(gains={"when": 0.02})
def fails_late(y, gains, memory):
    return (math.nan if y.t > gains.when else -y.e), y.e


@smc.law_function
def slow(y, gains, memory):
    return -float(str(y.e)), y.e  # numba knows no such float


# batches


@pytest.mark.parametrize("steps", [1, 200, 10**9])
def test_batches_hold_every_scenario_once_and_agree_on_its_layout(monkeypatch, steps):
    monkeypatch.setattr(executor, "STEPS", steps)
    scenarios = mixed()
    found = list(executor.batches(scenarios, threads=2))
    assert sorted(map(id, scenarios)) == sorted(id(s) for batch in found for s in batch)
    for batch in found:
        assert len({(s.plant.name, s.integrator, s.physics_step) for s in batch}) == 1
        assert len(batch) == 1 or sum(s.work for s in batch) <= 2 * steps


def test_a_batch_is_bounded_by_memory_however_many_threads_there_are():
    scenarios = [paper.scenario("duffing", "classical", seed=seed) for seed in range(400)]
    assert max(len(batch) for batch in executor.batches(scenarios, threads=512)) <= executor.LOG_STEPS / 10_000


def test_what_does_not_compile_goes_in_small_batches():
    scenarios = [smc.Scenario(plant="duffing", law=slow(), seed=seed) for seed in range(4)]
    assert [len(batch) for batch in executor.batches(scenarios, threads=2)] == [1, 1, 1, 1]


def test_outcomes_come_in_the_order_of_the_batch_and_do_not_depend_on_it():
    batch = [smc.Scenario(plant="duffing", law=fails_late(when=w), duration=0.05) for w in (1.0, 0.01, 0.02)]
    together = [executor.outcome(trace) for trace in executor.simulated(batch, 2)]
    assert together == [executor.outcome(trace) for s in batch for trace in executor.simulated([s], 1)]
    assert [found["diverged_at"] for found in together] == [None, 0.011, 0.021]


def test_a_batch_is_finished_while_the_next_one_runs_and_what_that_raises_is_heard():
    batches = list(executor.batches(mixed(), threads=1))
    finished = []
    executor.local(batches, 1, lambda batch, traces: finished.append((batch, [t.scenario for t in traces])))
    assert [batch for batch, _ in finished] == [done for _, done in finished] == batches

    for doomed in (batches[0], batches[-1]):

        def full(batch, traces, doomed=doomed):
            if batch is doomed:
                raise smc.ScenarioError("no room")

        with pytest.raises(smc.ScenarioError, match="no room"):
            executor.local(batches, 1, full)


# addresses


@pytest.mark.parametrize(
    "name", ["ray", "dask", "dask://", "dask://host", "dask://host:port", "dask://a:99999", None, 3]
)
def test_an_executor_that_there_is_not_is_one_sentence(name):
    with pytest.raises(smc.ScenarioError, match=r"give 'local' or 'dask://HOST:PORT'"):
        executor.checked(name)


def test_without_the_package_the_sentence_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(smc.ScenarioError, match=r"pip install 'smc-mujoco\[cluster\]'"):
        study(mixed(), tmp_path, executor="dask://localhost:1")


def test_a_law_that_no_worker_could_find_is_one_sentence(monkeypatch):
    with pytest.raises(smc.ScenarioError, match="define it at the top of a module"):
        cluster._packed([smc.Scenario(plant="duffing", law=smc.law_function(lambda y, gains, memory: (0.0, y.e))())])
    monkeypatch.setattr(slow.function, "__module__", "__main__")
    with pytest.raises(smc.ScenarioError, match="put it in a module that workers can import"):
        cluster._packed([smc.Scenario(plant="duffing", law=slow())])


# a cluster

CLIENT = """
import sys
from pathlib import Path
import smc_mujoco as smc
from smc_mujoco import cluster, executor
from smc_mujoco.grids import grid
from smc_mujoco.study import study

out, address, executor.STEPS, cluster.WAIT = Path(sys.argv[1]), sys.argv[2], 400, float(sys.argv[3])
scenarios = grid(["duffing"], ["classical"], ["nominal", "noise"], 60, "study", 0.2)
try:
    study(scenarios, out / "remote", executor=address)
except smc.ScenarioError as error:
    sys.exit(str(error))
study(scenarios, out / "local")
print((out / "remote" / "results.parquet").read_bytes() == (out / "local" / "results.parquet").read_bytes())
"""


def start(*arguments: str, log: Path) -> subprocess.Popen[str]:
    with log.open("w") as file:
        return subprocess.Popen(
            [sys.executable, *arguments],
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
            stderr=file,
            text=True,
        )


def wait(there: Callable[[], object]) -> None:
    end = time.monotonic() + 120
    while not there():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.fixture
def dask(tmp_path) -> Iterator[tuple[str, list[subprocess.Popen]]]:
    """The address of a scheduler, and its two workers."""
    file = tmp_path / "scheduler.json"
    common = "--no-dashboard", "--scheduler-file", str(file)
    scheduler = ["-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", *common]
    worker = ["-m", "distributed.cli.dask_worker", "--no-nanny", "--nthreads", "1", *common]
    worker += ["--local-directory", str(tmp_path)]
    running = [start(*scheduler, log=tmp_path / "scheduler.log")]
    try:
        running += [start(*worker, log=tmp_path / f"worker{i}.log") for i in range(2)]
        wait(lambda: file.exists() and file.stat().st_size)
        yield json.loads(file.read_text())["address"].replace("tcp://", "dask://"), running[1:]
    finally:
        for process in running:
            process.kill()
            process.communicate()


def test_a_worker_that_is_killed_in_mid_run_changes_nothing(dask, tmp_path):
    address, workers = dask
    client = start("-c", CLIENT, str(tmp_path), address, "60", log=tmp_path / "client.log")
    parts = tmp_path / "remote" / "parts"
    wait(lambda: client.poll() is not None or len(list(parts.glob("*.parquet"))) >= 3)
    assert client.poll() is None, (tmp_path / "client.log").read_text()
    assert not (tmp_path / "remote" / "results.parquet").exists()  # there is work left
    workers[0].send_signal(signal.SIGKILL)
    said, _ = client.communicate(timeout=120)
    assert (said, client.returncode) == ("True\n", 0), (tmp_path / "client.log").read_text()
    assert (workers[0].poll(), workers[1].poll()) == (-signal.SIGKILL, None)


def test_without_a_scheduler_there_the_sentence_says_so(tmp_path):
    client = start("-c", CLIENT, str(tmp_path), "dask://127.0.0.1:9", "0.5", log=tmp_path / "client.log")
    client.communicate(timeout=120)
    said = (tmp_path / "client.log").read_text().splitlines()[-1]
    assert said.startswith("no dask at dask://127.0.0.1:9")
    assert said.endswith("start `dask scheduler` and `dask worker` there")
