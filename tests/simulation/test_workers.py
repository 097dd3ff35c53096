"""Where calls are made makes no difference to what they give; what can go wrong there is told."""

import os
import pickle
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from pathlib import Path

import pytest

import smc_mujoco as smc
from smc_mujoco.analysis.tuning.objective import Objective
from smc_mujoco.analysis.tuning.search import search_task, tune
from smc_mujoco.simulation import run_key, workers
from smc_mujoco.simulation.grid import grid
from smc_mujoco.simulation.workers import called, opened
from smc_mujoco.studies import batches
from smc_mujoco.studies.study import study

pytestmark = pytest.mark.quick
ROOT = Path(__file__).parents[2]
PLANTS = ["duffing", "pendulum_network"]
SHORT = {"duration": 0.5, "conditions": ("nominal", "noise + coulomb")}


def runs() -> list[smc.Scenario]:
    return grid(PLANTS, ["classical", "none"], ["nominal", "coulomb"], 3, "study", 0.05)


class Elsewhere(ThreadPoolExecutor):
    """Workers that get bytes, as those of another process do; from call `last` on they come to an
    end.
    """

    calls = 0
    last = 10**9
    end = staticmethod(Future)

    def submit(self, fn, /, *args, **kwargs):
        self.calls += 1
        if self.calls >= self.last:
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


def shut_down() -> Future:
    raise RuntimeError("cannot schedule new futures after shutdown")


def test_the_workers_of_any_executor_find_the_same_table(tmp_path, monkeypatch):
    monkeypatch.setattr(batches, "MAX_WORK", 200)
    with Elsewhere(2) as pool:
        study(runs(), tmp_path / "elsewhere", executor=pool)
        assert pool.submit(abs, -1).result() == 1  # it stays open
    study(runs(), tmp_path / "here")
    elsewhere, here = (tmp_path / name / "results.parquet" for name in ("elsewhere", "here"))
    assert pool.calls > 4
    assert elsewhere.read_bytes() == here.read_bytes()


def test_searches_on_workers_find_the_same_gains_and_their_folder_makes_none_twice(tmp_path):
    goal = Objective(**SHORT)
    with Elsewhere(2) as pool:
        two = tune("duffing", "pid", 2, 0, goal, searches=2, out=tmp_path, executor=pool)
        three = tune("duffing", "pid", 2, 0, goal, searches=3, out=tmp_path, executor=pool)
    assert pool.calls == 3
    assert three.searches == tune("duffing", "pid", 2, 0, goal, searches=3).searches
    assert three.searches[:2] == two.searches


def test_results_come_as_they_end_and_no_more_calls_are_out_than_allowed(monkeypatch):
    monkeypatch.setattr(workers, "MAX_SENT", 2)
    results = {}
    with Elsewhere(1) as pool:

        def calls():
            for k in range(5):
                assert pool.calls - len(results) <= 2
                yield (-k,)

        for i, result in called(pool, abs, calls()):
            results[i] = result
    assert results == {k: k for k in range(5)}


@pytest.mark.parametrize("end", [died, cancelled, shut_down])
def test_an_executor_that_stops_is_one_sentence_and_finished_runs_stay(
    end, tmp_path, monkeypatch, refused
):
    monkeypatch.setattr(batches, "MAX_WORK", 200)
    monkeypatch.setattr(workers, "MAX_SENT", 1)
    with Elsewhere(1) as pool:
        pool.last = 4
        pool.end = end
        refused(lambda: study(runs(), tmp_path, executor=pool), "the executor has stopped (")
    assert len(list((tmp_path / "parts").glob("*.parquet"))) == 3


def test_results_that_have_arrived_come_before_the_error():
    ends = [died(), *(Future() for _ in range(4))]
    for future in ends[1:]:
        future.set_result(1)
    pool = Elsewhere(1)
    pool.last = 1
    pool.end = iter(ends).__next__
    results = called(pool, abs, [(k,) for k in range(5)])
    assert len([next(results) for _ in range(4)]) == 4
    with pytest.raises(smc.ScenarioError, match="a worker was killed"):
        next(results)


def raising(why):
    raise ZeroDivisionError(why)


def test_what_a_call_raises_is_raised_here():
    with Elsewhere(1) as pool, pytest.raises(ZeroDivisionError, match="the user's own"):
        list(called(pool, raising, [("the user's own",)]))


def test_a_worker_with_other_software_loads_nothing(monkeypatch, refused):
    here = workers.software()
    monkeypatch.setattr(workers, "software", lambda: here | {"mujoco": "3.1.0"})
    call = workers.packed((raising, ("it was called",)))
    refused(lambda: workers._on_worker(call, here), "mujoco 3.1.0")


def test_a_law_that_a_worker_cannot_import_is_named(refused):
    call = workers.packed((abs, (-1,))).replace(b"abs", b"sba")
    refused(lambda: workers._on_worker(call, workers.software()), "sba", "your own modules")


def test_a_law_of_other_code_on_a_worker_is_named(refused):
    (scenario, *_) = runs()
    refused(lambda: batches.scored([scenario], ["another key"]), "classical")
    made_of = smc.plant("duffing"), smc.law("pid"), Objective(**SHORT), 1, 0, False
    refused(lambda: search_task(*made_of, False, "other code", 0, "", 0), "pid")


def test_a_law_without_a_module_is_sent_by_value(monkeypatch, refused):
    law = smc.law_function(lambda y, gains, memory: (-y.e, y.e))()
    scenario = smc.Scenario(plant="duffing", duration=0.1, law=law)
    with Elsewhere(1) as pool:
        call = ([scenario], [run_key.run_key(scenario)])
        ((_, (columns,)),) = called(pool, batches.scored, [call])
    assert columns == batches.result_columns(smc.run(scenario))
    monkeypatch.setitem(sys.modules, "cloudpickle", None)
    refused(lambda: workers.packed(scenario), "pip install cloudpickle")


@pytest.mark.parametrize("name", ["ray", "dask://", "dask://host", "dask://host:port", 3])
def test_an_executor_that_there_is_not_is_one_sentence(name, refused):
    call = smc.compare, "pid", "duffing", "nominal"
    refused(lambda: call[0](*call[1:], executor=name), name, "dask://HOST:PORT")


def test_without_dask_the_sentence_says_what_to_install(monkeypatch, refused):
    monkeypatch.setitem(sys.modules, "distributed", None)
    refused(lambda: opened("dask://localhost:1").__enter__(), "smc-mujoco[cluster]")


def test_without_certificates_the_sentence_says_where_dask_looks_for_them(refused):
    pytest.importorskip("distributed")
    refused(lambda: opened("tls://localhost:1").__enter__(), "distributed.comm.tls")


# a cluster of dask on this machine

CLIENT = """
import math, sys, time
from pathlib import Path
import smc_mujoco as smc
from smc_mujoco.simulation import run_key, workers
from smc_mujoco.studies import batches
from smc_mujoco.studies.study import Store

out, address = Path(sys.argv[1]), sys.argv[2]
batches.MAX_WORK, workers.MAX_SENT, workers.TIMEOUT = 400, 4, 2.0

@smc.law_function(gains={"k": 4.0})
def of_this_script(y, gains, memory):  # which is __main__, and another one in a worker
    s = y.de + 3.0 * y.e
    return -gains.k * math.tanh(s), s

runs = smc.grid(["duffing"], ["classical", of_this_script], ["nominal", "noise"], 30, duration=0.2)
add = Store.add

def add_and_wait(store, rows):  # at the third part for the file "go", so that work is left then
    add(store, rows)
    while len(list(store.parts.glob("*.parquet"))) == 3 and not (out / "go").exists():
        time.sleep(0.02)

Store.add = add_and_wait
try:
    smc.study(runs, out / "there", executor=address)
except smc.ScenarioError as error:
    sys.exit(str(error))
Store.add = add
smc.study(runs, out / "here")
print((out / "there/results.parquet").read_bytes() == (out / "here/results.parquet").read_bytes())
"""


def start(*arguments: str, log: Path, **environment: str) -> subprocess.Popen[str]:
    with log.open("w") as file:
        return subprocess.Popen(
            [sys.executable, *arguments],
            env=os.environ | {"PYTHONPATH": str(ROOT)} | environment,
            stdout=subprocess.PIPE,
            stderr=file,
            text=True,
        )


def wait(there) -> None:
    end = time.monotonic() + 300
    while not there():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.fixture
def half_done(tmp_path):
    """A study on two dask workers whose first three parts are written, and that waits for the file
    "go"; with its processes: scheduler, workers, client.
    """
    pytest.importorskip("distributed")
    log = tmp_path / "scheduler.log"
    cli = "-m", "distributed.cli.dask_scheduler"
    where = "--host", "127.0.0.1", "--port", "0", "--no-dashboard"
    running = [start(*cli, *where, log=log)]
    try:
        wait(lambda: "Scheduler at" in log.read_text())
        (url,) = re.findall(r"Scheduler at:\s+(tcp://[\d.:]+)", log.read_text())
        for k in range(2):
            options = "--no-nanny", "--nthreads", "1", "--no-dashboard"
            folder = "--local-directory", str(tmp_path)
            worker = "-m", "distributed.cli.dask_worker", url, *options, *folder
            running.append(start(*worker, log=tmp_path / f"worker{k}.log"))
        address = url.replace("tcp://", "dask://")
        running.append(start("-c", CLIENT, str(tmp_path), address, log=tmp_path / "client.log"))
        parts = tmp_path / "there" / "parts"
        client = running[-1]
        wait(lambda: client.poll() is not None or len(list(parts.glob("*.parquet"))) >= 3)
        assert client.poll() is None, (tmp_path / "client.log").read_text()
        yield running
    finally:
        for process in running:
            process.kill()
            process.communicate()


@pytest.mark.slow
def test_a_worker_that_is_killed_in_mid_run_changes_nothing(half_done, tmp_path):
    _, worker, _, client = half_done
    worker.send_signal(signal.SIGKILL)
    (tmp_path / "go").touch()
    said, _ = client.communicate(timeout=300)
    assert (said, client.returncode) == ("True\n", 0), (tmp_path / "client.log").read_text()


@pytest.mark.slow
def test_a_scheduler_that_is_killed_in_mid_run_is_one_sentence_and_finished_runs_stay(
    half_done, tmp_path
):
    scheduler, *_, client = half_done
    scheduler.send_signal(signal.SIGKILL)
    (tmp_path / "go").touch()
    client.communicate(timeout=300)
    log = (tmp_path / "client.log").read_text()
    assert client.returncode == 1, log
    assert log.splitlines()[-1].startswith(("the executor has stopped (dask", "no dask at ")), log
    assert len(list((tmp_path / "there" / "parts").glob("*.parquet"))) >= 3
