"""The audit of one paper as one HTML file, with its evidence, badge and figure beside it.

report("levant_1993", "levant")                # levant/report.html, which needs no other file and no network
"""

from collections import Counter
from pathlib import Path

from smc_mujoco.common import extras
from smc_mujoco.common.files import replacing, write_json
from smc_mujoco.common.progress import bar
from smc_mujoco.common.text import number
from smc_mujoco.common.version import __version__
from smc_mujoco.evidence.audit import evidence
from smc_mujoco.evidence.audit.audit import Audit, audit
from smc_mujoco.evidence.audit.figure import badge
from smc_mujoco.evidence.audit.verdict import ANSWERS, VERDICTS, summary
from smc_mujoco.evidence.report import words
from smc_mujoco.evidence.report.page import TEMPLATES, environment, uri

SECTIONS = {
    "claims": "The claims",
    "checks": "How far from the thresholds",
    "gains": "Gains",
    "method": "How it was computed",
}


def report(
    paper: str | Path,
    out: str | Path = "report",
    quick: bool = False,
    threads: int | None = None,
    progress: bool = False,
) -> Path:
    """Audit a paper and write its report, out/report.html, with evidence.json, badge.svg and
    checks.svg beside it.
    """
    if why := extras.missing("report", "a report", "jinja2"):
        raise extras.MissingPackageError(why)
    folder = Path(out)
    with bar("claims", shown=progress, counted=True) as drawn:
        done = audit(paper, quick=quick, threads=threads, report=drawn.reached)
    document = evidence.document(done)
    write_json(folder / "evidence.json", document)
    done.badge(folder / "badge.svg")
    done.figure(folder / "checks.svg")
    html = page(done, document["seal"], len(document["runs"]), (folder / "checks.svg").read_bytes())
    with replacing(folder / "report.html") as part:
        part.write_text(html, encoding="utf-8")
    return folder / "report.html"


def page(done: Audit, seal: str, runs: int, figure: bytes) -> str:
    """Return an audit as HTML."""
    from markupsafe import Markup

    counts = Counter(claim.verdict for claim in done.claims)
    kinds = (*VERDICTS, *ANSWERS.values())
    sets = list(done.claims[0].verdicts)
    template = environment().get_template("paper.jinja")
    return template.render(
        css=Markup((TEMPLATES / "style.css").read_text(encoding="utf-8")),
        js=Markup((TEMPLATES / "page.js").read_text(encoding="utf-8")),
        paper=done.paper,
        claims=done.claims,
        counts={verdict: counts[verdict] for verdict in kinds if counts[verdict]},
        summary=summary(done.claims),
        sets=sets,
        gains_set=sets[-1],
        gains={name: gains(done, name) for name in sets},
        quick=done.quick,
        sections=SECTIONS,
        link=lambda what: "verdict",
        badge=uri("image/svg+xml", badge(done.name, done.claims).encode()),
        figure=figure,
        runs=runs,
        seal=seal,
        varying=[id for id, entry in done.paper.claims.items() if entry.varies and id in done.used],
        version=__version__,
    )


def gains(done: Audit, name: str) -> dict[tuple[str, str], list[str]]:
    """Return (law, its gains in words) -> the plants on which runs under a set of gains had them."""
    plants: dict[tuple[str, str], list[str]] = {}
    for sets in done.used.values():
        for run in sets.get(name, {}).values():
            law = run.scenario.law
            plant = words.plant(run.scenario.plant.name)
            values = ", ".join(f"{gain} = {number(value)}" for gain, value in law.gains.items())
            on = plants.setdefault((law.name, values), [])
            if plant not in on:
                on.append(plant)
    return dict(sorted(plants.items()))
