"""The evidence of an audit as a JSON file that anybody can make again, to the last bit.

    audit("gaber").save("evidence.json")
    check("evidence.json")                    # raises if the file was changed after it was written

It leads from each claim to its runs, their numbers, the threshold and the verdict. A run is named
by a hash of its scenario, and has a hash of what the claim took from it: its scores or its trace.
There are hashes of the paper's own files. The seal is a hash of all the rest. There are no times,
no paths and nothing about the machine.
"""

import hashlib
import sys
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from smc_mujoco.common import fingerprint
from smc_mujoco.common.aliases import Fields
from smc_mujoco.common.data import attributes
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.files import read_json, reading, sealed, unsealed
from smc_mujoco.common.version import __version__
from smc_mujoco.evidence.audit.paper import TEXT_FIELDS, Paper
from smc_mujoco.evidence.audit.verdict import totals
from smc_mujoco.mechanisms.plant import plant_catalogue as plants
from smc_mujoco.simulation.run_key import condition, portable_key
from smc_mujoco.simulation.scenario import Scenario

FORMAT = "smc-mujoco evidence 1"
CLAIM_FIELDS = ("id", "text", "where", "whose", "how", "read")
CLAIM_FIELDS += ("measured", "holds_if", "quantifier", "over")
HASHED_SUFFIXES = (".py", ".toml", ".xml")  # of a paper's files that are hashed


def document(audit: Any) -> Fields:
    """Return the evidence of an audit as plain data, with its seal."""
    if not audit.sealable:
        raise ScenarioError("evidence is of runs that the audit made itself: leave out the table")
    names: dict[str, str] = {}  # key of a run -> its name in the file
    runs: Fields = {}
    for by_set in audit.used.values():
        for used in by_set.values():
            for key, run in used.items():
                name = names[key] = names.get(key) or portable_key(run.scenario)
                about = runs.setdefault(name, _run(run.scenario))
                if run.scores:
                    about["scores"] = run.scores
                if run.trace:
                    about["trace"] = run.trace
    sealable = []
    for claim in audit.claims:
        if not audit.paper.claims[claim.id].varies:
            sealable.append(claim)
    left_out = []
    for id in audit.paper.claims:
        if id not in audit.used:
            left_out.append(id)
    texts = attributes(audit.paper, ("name", *TEXT_FIELDS))
    data = {
        "format": FORMAT,
        "paper": texts | {"files": files(audit.paper)},
        "software": {
            "smc_mujoco": __version__,
            "mujoco": version("mujoco"),
            "numba": version("numba"),
            "numpy": version("numpy"),
            "python": f"{sys.version_info.major}.{sys.version_info.minor}",
            "code": fingerprint.package("testing", "draw", fingerprint.PAPERS),
        },
        "quick": audit.quick,
        "left_out": left_out,
        "counts": dict(sorted(totals(sealable).items())),  # of the paper's own sentences
        "claims": [_claim(audit, claim, names) for claim in audit.claims],
        "runs": dict(sorted(runs.items())),
    }
    return sealed(data)


def read_sealed(path: str | Path) -> Fields:
    """Return the evidence in a file, or raise ScenarioError if its seal is broken."""
    with reading(
        path, "file of evidence", "give one that `smc-mujoco claims --evidence FILE.json` wrote"
    ) as file:
        data = read_json(file)
        if data["format"] != FORMAT:
            raise ScenarioError(
                f"its format is {data['format']!r}, and this version reads {FORMAT!r}"
            )
    return unsealed(data)


def files(paper: Paper) -> dict[str, str]:
    """Return file -> hash of a paper's files, the same for every kind of line ending."""
    hashes = {}
    for path in sorted(paper.folder.rglob("*")):
        if path.suffix in HASHED_SUFFIXES and path.is_file():
            text = path.read_bytes().replace(b"\r\n", b"\n")
            name = path.relative_to(paper.folder).as_posix()
            hashes[name] = hashlib.sha256(text).hexdigest()
    return hashes


def _claim(audit: Any, claim: Any, names: Mapping[str, str]) -> Fields:
    """Return the part of a claim that is sealed."""
    entry = audit.paper.claims[claim.id]
    fields = attributes(claim, CLAIM_FIELDS)
    if entry.immune:
        fields["immune"] = entry.immune
    if entry.varies:
        return fields | {"not_sealed": f"its numbers differ from audit to audit: {entry.varies}"}
    runs = {}
    for name, used in audit.used[claim.id].items():
        runs[name] = sorted({names[key] for key in used})
    judged = ("numbers", "beside", "verdicts", "verdict", "flips", "note")
    return fields | {"runs": runs} | attributes(claim, judged)


def _run(scenario: Scenario) -> Fields:
    """Return a short description of a run. Its name is a hash of the whole scenario."""
    plant = scenario.plant
    suite = plants().get(scenario.plant.name)
    if suite:
        suite_parameters = dict(suite.parameters) | {"n": suite.n}
    else:
        suite_parameters = {}
    changed = {}  # other than the suite's
    for name, value in (dict(plant.parameters) | {"n": plant.n}).items():
        if name not in suite_parameters or suite_parameters[name] != value:
            changed[name] = value
    return {
        "plant": plant.name,
        "parameters": changed,
        "law": scenario.law.name,
        "gains": dict(scenario.law.gains),
        "condition": condition(scenario),
        "duration": scenario.duration,
        "seed": scenario.seed,
    }
