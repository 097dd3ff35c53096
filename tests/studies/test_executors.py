"""Where runs are computed makes no difference to what a study finds."""

import json
import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from helpers.runs import fails_late

import smc_mujoco as smc
from smc_mujoco.simulation.grid import grid
from smc_mujoco.simulation.prepare import prepare
from smc_mujoco.studies import executors, run_key
from smc_mujoco.studies.study import study

ROOT = Path(__file__).parents[2]


def mixed() -> list[smc.Scenario]:
    return grid(
        ["duffing", "pendulum_network"],
        ["classical", "none"],
        ["nominal", "coulomb"],
        3,
        "study",
        0.05,
    )


@smc.law_function
def slow(y, gains, memory):
    return -float(str(y.e)), y.e  # numba knows no such float


# batches


@pytest.mark.parametrize("steps", [1, 200, 10**9])
def test_batches_hold_every_scenario_once_and_agree_on_its_layout(monkeypatch, steps):
    monkeypatch.setattr(executors, "MAX_WORK", steps)
    scenarios = mixed()
    found = list(executors.batches(scenarios))
    assert sorted(map(id, scenarios)) == sorted(
        id(one.scenario) for batch in found for one in batch
    )
    for batch in [[one.scenario for one in batch] for batch in found]:
        assert (
            len({(s.plant.name, s.resolved.integrator, s.resolved.physics_step) for s in batch})
            == 1
        )
        assert len(batch) == 1 or sum(s.work for s in batch) <= steps


def test_outcomes_come_in_the_order_of_the_batch_and_do_not_depend_on_it():
    batch = []
    for w in (1.0, 0.01, 0.02):
        batch.append(smc.Scenario(plant="duffing", law=fails_late(when=w), duration=0.05))
    together = []
    for trace in executors.run_batch(batch, 2):
        together.append(executors.result_columns(trace))
    assert together == [
        executors.result_columns(trace) for s in batch for trace in executors.run_batch([s], 1)
    ]
    assert [found["diverged_at"] for found in together] == [None, 0.011, 0.021]


def test_a_batch_is_finished_while_the_next_one_runs_and_what_that_raises_is_heard():
    batches = list(executors.batches(mixed()))
    finished = []
    executors.compute_here(
        batches, 1, lambda batch, traces: finished.append((batch, [t.scenario for t in traces]))
    )
    assert [batch for batch, _ in finished] == batches
    assert [[one.scenario for one in batch] for batch in batches] == [done for _, done in finished]

    for doomed in (batches[0], batches[-1]):

        def full(batch, traces, doomed=doomed):
            if batch is doomed:
                raise smc.ScenarioError("no room")

        with pytest.raises(smc.ScenarioError, match="no room"):
            executors.compute_here(batches, 1, full)


# addresses


@pytest.mark.parametrize(
    "name",
    [
        "ray",
        "dask",
        "dask://",
        "dask://host",
        "dask://host:port",
        None,
        3,
        np.zeros(2),
    ],
)
def test_an_executor_that_there_is_not_is_one_sentence(name):
    with pytest.raises(
        smc.ScenarioError, match=r"give 'local', 'dask://HOST:PORT', a dask Client or a"
    ):
        executors.as_executor(name)


def test_without_the_package_the_sentence_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(smc.ScenarioError, match=r"pip install 'smc-mujoco\[cluster\]'"):
        study(mixed(), tmp_path, executor="dask://localhost:1")


# any Executor


class Elsewhere(ThreadPoolExecutor):
    """Workers that get bytes, as those of another process do; from task `last` on they come to an
    end.
    """

    tasks = 0
    last = 10**9

    def submit(self, fn, /, *args, **kwargs):
        self.tasks += 1
        if self.tasks >= self.last:
            return self.end()
        fn, args, kwargs = pickle.loads(pickle.dumps((fn, args, kwargs)))
        return super().submit(fn, *args, **kwargs)


def died() -> Future:
    future = Future()
    future.set_exception(BrokenExecutor("a worker was killed"))
    return future


def cancelled() -> Future:
    future = Future()
    future.cancel()
    future.set_running_or_notify_cancel()
    return future


def refused() -> Future:
    raise RuntimeError("cannot schedule new futures after shutdown")


def test_the_workers_of_any_executor_find_the_same_table(tmp_path, monkeypatch):
    monkeypatch.setattr(executors, "MAX_WORK", 200)
    with Elsewhere(2) as pool:
        study(mixed(), tmp_path / "elsewhere", executor=pool)
        assert pool.submit(abs, -1).result() == 1  # it stays open
    study(mixed(), tmp_path / "local")
    tables = []
    for where in ("elsewhere", "local"):
        tables.append((tmp_path / where / "results.parquet").read_bytes())
    assert pool.tasks > 4
    assert tables[0] == tables[1]


def test_no_more_batches_are_under_way_than_allowed(monkeypatch):
    monkeypatch.setattr(executors, "MAX_BATCHES_SENT", 2)
    finished = []
    with Elsewhere(1) as pool:

        def batches():
            for scenario in mixed():
                assert pool.tasks - len(finished) <= 2
                yield [prepare(scenario)]

        executors.compute_elsewhere(
            batches(), pool, lambda batch, outcomes: finished.append(batch[0].scenario)
        )
    assert sorted(map(repr, finished)) == sorted(map(repr, mixed()))


@pytest.mark.parametrize("end", [died, cancelled, refused])
def test_when_an_executor_stops_one_sentence_says_so_and_what_is_finished_stays(
    end, tmp_path, monkeypatch
):
    monkeypatch.setattr(executors, "MAX_WORK", 200)
    monkeypatch.setattr(executors, "MAX_BATCHES_SENT", 1)
    with Elsewhere(1) as pool:
        pool.last = 4
        pool.end = end
        with pytest.raises(
            smc.ScenarioError,
            match=r"^the executor has stopped \(.+\): start it and the study again to continue$",
        ):
            study(mixed(), tmp_path, executor=pool)
    assert len(list((tmp_path / "parts").glob("*.parquet"))) == 3


def test_finished_parts_are_kept_before_an_error_is_raised(monkeypatch):
    batches = [[prepare(scenario)] for scenario in mixed()[:6]]
    kept = []
    ends = [died(), *(Future() for _ in batches[1:])]
    for future in ends[1:]:
        future.set_result([])
    pool = Elsewhere(1)
    pool.last = 1
    pool.end = iter(ends).__next__
    with pool, pytest.raises(smc.ScenarioError, match="a worker was killed"):
        executors.compute_elsewhere(batches, pool, lambda batch, outcomes: kept.append(batch))
    assert len(kept) == 5


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            ("smc_mujoco.studies.run_key.key", lambda scenario, plants=None: "other"),
            "a worker has other code for .*: install the same",
        ),
        (
            ("pickle.loads", lambda data: smc.nowhere),
            "nowhere",  # an ImportError, of which the sender makes a sentence
        ),
    ],
)
def test_a_worker_that_would_run_something_else_is_one_sentence(change, said, monkeypatch):
    batch = mixed()[:1]
    keys = [run_key.key(s) for s in batch]
    packed = pickle.dumps(batch)
    monkeypatch.setattr(*change)
    with pytest.raises((smc.ScenarioError, ImportError), match=said):
        executors.run_on_worker(packed, keys)


def test_a_law_without_a_module_is_sent_by_value(monkeypatch):
    scenario = smc.Scenario(
        plant="duffing", duration=0.1, law=smc.law_function(lambda y, gains, memory: (-y.e, y.e))()
    )
    found = []
    with Elsewhere(1) as pool:
        executors.compute_elsewhere(
            [[prepare(scenario)]], pool, lambda batch, its: found.extend(its)
        )
    assert found == [executors.result_columns(smc.run(scenario))]
    monkeypatch.setitem(sys.modules, "cloudpickle", None)
    with pytest.raises(smc.ScenarioError, match="put it into a module, or pip install cloudpickle"):
        executors.packed(scenario)


# a cluster

CLIENT = """
import math, sys, time
from pathlib import Path
import smc_mujoco as smc
from smc_mujoco.studies import executors
from smc_mujoco.simulation.grid import grid
from smc_mujoco.studies.study import Store
from smc_mujoco.studies.study import study

out, address, executors.MAX_WORK, executors.TIMEOUT = Path(sys.argv[1]), sys.argv[2], 400, float(sys.argv[3])
executors.MAX_BATCHES_SENT = 4  # few, so that most of the work is not even sent when the third part is written
SLOPE = 3.0

@smc.law_function(gains={"k": 4.0}, conditions={"k > 0": lambda g: g.k > 0.0})
def of_this_script(y, gains, memory):  # which is __main__, and another one in a worker
    s = y.de + SLOPE * y.e
    return -gains.k * math.tanh(s), s

scenarios = grid(["duffing"], ["classical", of_this_script], ["nominal", "noise"], 30, "study", 0.2)
scenarios += smc.problem("duffing/noise@1").scenarios("pid", range(3))  # as an entry of the benchmark runs them
add = Store.add

def add_and_wait(store, rows):  # at the third part for the file "go", so that there is work left until then
    add(store, rows)
    if store.parts.parent.name == "remote":
        with (out / "hashes").open("a") as file:
            file.writelines(row["hash"] + "\\n" for row in rows)
    while len(list(store.parts.glob("*.parquet"))) == 3 and not (out / "go").exists():
        time.sleep(0.02)

Store.add = add_and_wait
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
    end = time.monotonic() + 300
    while not there():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.fixture(scope="module")
def dask(
    tmp_path_factory,
) -> Iterator[tuple[str, list[subprocess.Popen], Callable[[], subprocess.Popen]]]:
    """The address of a scheduler; its process and that of its worker; what starts another
    worker.
    """
    tmp_path = tmp_path_factory.mktemp("dask")
    file = tmp_path / "scheduler.json"
    common = "--no-dashboard", "--scheduler-file", str(file)
    scheduler = [
        "-m",
        "distributed.cli.dask_scheduler",
        "--host",
        "127.0.0.1",
        "--port",
        "0",
        *common,
    ]
    worker = ["-m", "distributed.cli.dask_worker", "--no-nanny", "--nthreads", "1", *common]
    worker += ["--local-directory", str(tmp_path)]
    running = [start(*scheduler, log=tmp_path / "scheduler.log")]

    def another() -> subprocess.Popen:
        workers = len(running)
        running.append(start(*worker, log=tmp_path / f"worker{workers}.log"))
        wait(lambda: (tmp_path / "scheduler.log").read_text().count("Register worker") == workers)
        return running[-1]

    try:
        another()
        yield json.loads(file.read_text())["address"].replace("tcp://", "dask://"), running, another
    finally:
        for process in running:
            process.kill()
            process.communicate()


@pytest.fixture
def half_done(dask, tmp_path) -> Iterator[subprocess.Popen[str]]:
    """A study whose first three parts are written, and that waits for the file "go"."""
    # the client waits as long for a scheduler that has died as for one that has not started yet
    client = start("-c", CLIENT, str(tmp_path), dask[0], "5", log=tmp_path / "client.log")
    parts = tmp_path / "remote" / "parts"
    try:
        wait(lambda: client.poll() is not None or len(list(parts.glob("*.parquet"))) >= 3)
        assert client.poll() is None, (tmp_path / "client.log").read_text()
        assert not (tmp_path / "remote" / "results.parquet").exists()  # there is work left
        yield client
    finally:
        client.kill()
        client.communicate()


OWN_CLIENT = """
import sys
from pathlib import Path
from distributed import Client
import smc_mujoco as smc
folder, address = sys.argv[1:]
runs = smc.grid(["duffing"], ["classical"], ["noise"], 2, duration=0.1)
smc.study(runs, f"{folder}/here")
smc.study(runs, f"{folder}/there", executor=address)
with Client(address) as client:
    smc.study(runs, f"{folder}/client", executor=client)
print(len({file.read_bytes() for file in Path(folder).glob("*/results.parquet")}))
"""


@pytest.mark.slow
def test_a_client_of_ones_own_and_its_address_give_the_same_table(dask, tmp_path):
    address = dask[0].replace("dask://", "tcp://")
    client = start("-c", OWN_CLIENT, str(tmp_path), address, log=tmp_path / "client.log")
    said, _ = client.communicate(timeout=300)
    assert (said, client.returncode) == ("1\n", 0), (tmp_path / "client.log").read_text()


@pytest.mark.slow
def test_a_worker_that_is_killed_in_mid_run_changes_nothing(dask, half_done, tmp_path):
    _, (_, worker), another = dask
    other = another()
    worker.send_signal(signal.SIGKILL)
    (tmp_path / "go").touch()
    said, _ = half_done.communicate(timeout=300)
    assert (said, half_done.returncode) == ("True\n", 0), (tmp_path / "client.log").read_text()
    assert worker.poll() == -signal.SIGKILL
    assert other.poll() is None


@pytest.mark.slow
def test_a_study_that_is_killed_in_mid_run_goes_on_over_the_workers_with_the_same_bytes(
    dask, half_done, tmp_path
):
    half_done.kill()
    half_done.wait()
    done = (tmp_path / "hashes").read_text().split()
    (tmp_path / "go").touch()
    again = start("-c", CLIENT, str(tmp_path), dask[0], "5", log=tmp_path / "again.log")
    said, _ = again.communicate(timeout=300)
    assert (said, again.returncode) == ("True\n", 0), (tmp_path / "again.log").read_text()
    every = (tmp_path / "hashes").read_text().split()
    assert 0 < len(done) < len(every) == len(set(every))  # what was done is not run again


@pytest.mark.slow
def test_a_scheduler_that_is_killed_in_mid_run_is_one_sentence_and_finished_runs_stay(
    dask, half_done, tmp_path
):
    _, (scheduler, *_), _ = dask
    scheduler.send_signal(signal.SIGKILL)
    (tmp_path / "go").touch()
    half_done.communicate(timeout=300)
    log = (tmp_path / "client.log").read_text()
    assert half_done.returncode == 1, log
    assert log.splitlines()[-1].startswith(("the executor has stopped (dask", "no dask at ")), log
    assert len(list((tmp_path / "remote" / "parts").glob("*.parquet"))) >= 3


@pytest.mark.slow
def test_without_a_scheduler_there_the_sentence_says_so(tmp_path):
    client = start(
        "-c", CLIENT, str(tmp_path), "dask://127.0.0.1:9", "0.5", log=tmp_path / "client.log"
    )
    client.communicate(timeout=300)
    said = (tmp_path / "client.log").read_text().splitlines()[-1]
    assert said.startswith("no dask at dask://127.0.0.1:9")
    assert said.endswith("start `dask scheduler` and `dask worker` there")


def test_a_result_that_comes_after_its_study_has_ended_is_dropped():
    class Late:
        def submit(self, fn, *args, **kwargs):
            return self

        def add_done_callback(self, told):
            self.told = told

        def result(self):
            return 1

    client = Late()
    found = executors._DaskExecutor(client).submit(abs, -1)
    assert found.cancel()
    client.told(client)
    assert found.cancelled()
