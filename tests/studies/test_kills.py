"""A study that is killed goes on where it was: nothing finished is lost or done twice, and the
table is the same.

One process loads and compiles once, and forks a process for every life of the study, before any
simulation has made a thread. A life says through a pipe what it does; what was there when it was
killed is all that the next one knows.
"""

import json
import os
import sys

import pytest
from helpers.commands import python

from smc_mujoco.simulation.grid import grid
from smc_mujoco.studies.study import study

LOADED = """
import os, random, signal, sys, time
from pathlib import Path
from smc_mujoco.studies import batches
from smc_mujoco.simulation.grid import grid
from smc_mujoco.simulation.run_key import run_key
from smc_mujoco.studies.study import Store, study
from smc_mujoco.simulation.callback import callback as compiled_callback, silence
from smc_mujoco.simulation.prepare import prepare
import pyarrow.parquet

out, batches.MAX_WORK = Path(sys.argv[1]), 60
plants, laws, conditions = ["duffing", "van_der_pol"], ["observer_free", "classical"], ["nominal", "noise"]
scenarios = grid(plants, laws, conditions, 10, "study", 0.05)
"""
KILLER = """
import json

for scenario in scenarios:
    prepare(scenario), run_key(scenario)
compiled_callback(), silence()

def told(pipe):
    # what a life does, as it does it: "run", "write", "wrote <hashes>", "collect"
    def tell(*words):
        os.write(pipe, " ".join(words).encode() + b"\\n")
    run, add, collect = batches.run_batch, Store.add, Store.collect
    def simulated(*rest):
        tell("run")
        return run(*rest)
    def adding(self, rows):
        tell("write")
        add(self, rows)
        tell("wrote", *(row["hash"] for row in rows))
    def collecting(self, *given):
        tell("collect")
        collect(self, *given)
    batches.run_batch, Store.add, Store.collect = simulated, adding, collecting

def live(folder, doomed):
    # one life of the study; doomed(line) says whether it dies there
    read, write = os.pipe()
    child = os.fork()
    if not child:
        os.close(read)
        told(write)
        study(scenarios, folder, threads=2)
        os._exit(0)
    os.close(write)
    wrote, last = [], "start"
    with os.fdopen(read) as lines:
        for line in lines:
            what, *hashes = line.split()
            wrote += hashes
            if last != "killed":
                last = what
                if doomed(what):
                    time.sleep(chance.uniform(0.0, 0.01))
                    os.kill(child, signal.SIGKILL)
                    at, last = what, "killed"
    status = os.waitpid(child, 0)[1]
    assert status == (signal.SIGKILL if last == "killed" else 0), status
    return wrote, (at if last == "killed" else None)

chance = random.Random(0)
undisturbed, _ = live(out / "undisturbed", lambda what: False)
wrote, ends = [], []
while len(ends) < 20:
    if len(ends) < 17:
        left = chance.randrange(1, 8)
        def doomed(what):
            global left
            left -= 1
            return left == 0
    else:
        doomed = lambda what: what == "collect"
    done, end = live(out / "killed", doomed)
    wrote += done
    assert end, "the study ended before it was killed"
    ends.append(end)
wrote += live(out / "killed", lambda what: False)[0]
same = [(out / name / "results.parquet").read_bytes() for name in ("undisturbed", "killed")]
print(json.dumps({"ends": ends, "wrote": wrote, "undisturbed": undisturbed, "same": same[0] == same[1]}))
"""
FULL = """
import resource
from smc_mujoco.cli.main import main

def filling(self, rows, add=Store.add, parts=[]):
    parts.append(rows)
    if len(parts) == 3:  # no file may be longer: what the kernel then says is what a full disk says
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
    add(self, rows)

Store.add = filling
words = "compare duffing --law classical --condition noise --seeds 20 --gains study --duration 0.05 --out"
main([*words.split(), str(out)])
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="lives are forked")
@pytest.mark.slow
def test_killed_twenty_times_a_study_ends_with_the_same_table_and_does_nothing_twice(tmp_path):
    done = python("-c", LOADED + KILLER, tmp_path, fine=False)
    assert done.returncode == 0, done.stderr
    output = json.loads(done.stdout)
    assert output["same"]
    assert len(output["ends"]) == 20
    assert {"run", "write", "wrote", "collect"} == set(output["ends"])  # where it was killed
    assert len(output["wrote"]) == len(set(output["wrote"]))
    assert set(output["wrote"]) <= set(output["undisturbed"])
    assert len(output["undisturbed"]) == 80


@pytest.mark.skipif(sys.platform == "win32", reason="limits of POSIX")
def test_on_a_full_disk_a_study_stops_with_one_sentence_and_later_goes_on(tmp_path):
    done = python("-c", LOADED + FULL, tmp_path, fine=False)
    assert done.returncode == 2, done.stderr
    # progress of a slow machine may stand before it
    (sentence,) = (line for line in done.stderr.splitlines() if "simulations" not in line)
    assert sentence.startswith("smc-mujoco: cannot write")
    assert sentence.endswith("choose another folder or make room")
    files = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path.is_file()}
    names = sorted(path.name for path in files if path.suffix != ".parquet")
    # two finished parts, no noise key yet, and nothing half done
    assert names == []
    assert len(files) == 2
    scenarios = grid(["duffing"], ["classical"], ["noise"], 20, "study", 0.05)
    study(scenarios, tmp_path)
    study(scenarios, tmp_path / "undisturbed")
    results = []
    for path in sorted(tmp_path.rglob("results.parquet")):
        results.append(path.read_bytes())
    assert results[0] == results[1]
    assert {path: path.stat().st_mtime_ns for path in files} == files
