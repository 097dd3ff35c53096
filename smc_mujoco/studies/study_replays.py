"""Replays in a study: one run of each of the user's laws on each plant in each condition, which no law can foresee."""

import hashlib
import json
import sys
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import write_json
from smc_mujoco.common.text import counted
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.simulation.run import PlainLoopWarning, run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.studies import run_key
from smc_mujoco.studies.executors import result_columns
from smc_mujoco.studies.noise_key import has_user_code
from smc_mujoco.studies.replay import replays
from smc_mujoco.studies.store import Store

FILE = "replays.json"
OTHER_SCORES = "run again, it has other scores: the law keeps a state of its own, or reads a clock"


def replayed(
    runs: Mapping[str, Scenario], store: Store, folder: Path, threads: int | None, progress: bool
) -> dict[str, dict[str, Any]]:
    """Replay chosen runs, those with no result in the folder. Return hash -> the columns that their replays change."""
    chosen, known = _chosen(runs), _known(folder / FILE)
    if missing := [name for name in chosen if name not in known]:
        if progress:
            print(f"replaying {counted(len(missing), 'run')} of your laws", file=sys.stderr)
        try:
            known |= _results({name: runs[name] for name in missing}, store, threads)
            write_json(folder / FILE, known)
        except ScenarioError as error:
            print(f"not replayed: {error}", file=sys.stderr)
    nothing = dict.fromkeys((*(metric.name for metric in metrics()), "diverged_at"))
    return {
        name: {"replayed": True} if known[name] == "" else {**nothing, "replayed": False, "failure": known[name]}
        for name in chosen
        if known.get(name) is not None
    }


def _chosen(runs: Mapping[str, Scenario]) -> list[str]:
    """Return the hash of one run for each of the user's laws, on each plant in each condition.

    The choice is by a hash of these hashes. They depend on the noise key, so it cannot be foreseen.
    """
    groups: dict[tuple, list[str]] = {}
    for name, scenario in runs.items():
        if has_user_code(scenario):
            group = scenario.law.name, scenario.plant.name, run_key.condition(scenario)
            groups.setdefault(group, []).append(name)
    return [min(names, key=lambda name: hashlib.sha256(name.encode()).digest()) for names in groups.values()]


def _known(file: Path) -> dict[str, str | None]:
    """Return the results in a file: hash -> what differs, "" for nothing, None for a run that cannot be replayed."""
    try:
        known = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return known if isinstance(known, dict) else {}


def _results(runs: Mapping[str, Scenario], store: Store, threads: int | None) -> dict[str, str | None]:
    """Run and replay runs. Return hash -> what differs, as in `_known`."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PlainLoopWarning)  # the study itself has warned
        traces = run(list(runs.values()), threads=threads)
    results: dict[str, str | None] = {}
    for name, trace, replay in zip(runs, traces, replays(traces), strict=True):
        row = store.row(name)
        if replay.same is None and trace.failure is None:
            print(f"not replayed: {trace.scenario.law.name}, {replay.why}", file=sys.stderr)
        if any(row.get(column) != value for column, value in result_columns(trace).items()):
            results[name] = OTHER_SCORES
        else:
            results[name] = None if replay.same is None else replay.why
    return results
