"""A law with the gains that searches found."""

import dataclasses

from smc_mujoco.analysis.tuning import search_space
from smc_mujoco.analysis.tuning.result import Tuned
from smc_mujoco.common.text import joined
from smc_mujoco.control import source
from smc_mujoco.control.component import Component
from smc_mujoco.studies.fair_gains import Candidate


def candidate_of(default: Component, tuned: Tuned) -> Candidate:
    """Return a law with the gains of each search, or with those that it had if no search found
    better ones.
    """
    found = tuned.law.source
    if tuned.before < tuned.objective:
        if default.source.kind == source.DEFAULT:
            own = "defaults"
        else:
            own = "own gains"
        kept = default.sourced(found.kind, found.search)
        return Candidate(kept, (kept,), f"its {own}, better than those tried")
    sets = []
    for tried in tuned.sets:
        gains = dict(default.gains) | dict(zip(tuned.bounds, tried.gains, strict=True))
        with_gains = dataclasses.replace(default, gains=gains)
        sets.append(with_gains.sourced(found.kind, found.search))
    best = dataclasses.replace(default, gains=tuned.law.gains).sourced(found.kind, found.search)
    remark = ""
    if names := list(search_space.without_unit(default)):
        remark = f"no unit, so searched about the default: {joined(names)}"
    return Candidate(best, tuple(sets), remark)
