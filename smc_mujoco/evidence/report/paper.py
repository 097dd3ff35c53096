"""The audit of one paper as one HTML file, with its evidence beside it.

report("levant_1993", "levant")      # levant/report.html, which needs no other file, no network
"""

from pathlib import Path

from smc_mujoco.common import extras
from smc_mujoco.common.files import write_json
from smc_mujoco.common.progress import bar
from smc_mujoco.common.tabular import Tabular
from smc_mujoco.evidence.audit import evidence
from smc_mujoco.evidence.audit.audit import Audit, audit

VERDICTS = (
    "A claim consists of sentences, each with checks of a number against its limit. Under one set "
    "of gains it is supported where every sentence holds, refuted where none does, and partly "
    "supported otherwise. Where the sets differ, one counter-example refutes a universal claim, "
    "and one example supports an existential one."
)


def report(
    paper: str | Path,
    out: str | Path = "report",
    quick: bool = False,
    threads: int | None = None,
    progress: bool = False,
) -> Path:
    """Audit a paper and write its report, out/report.html, with evidence.json beside it."""
    if why := extras.missing("report", "a report", "jinja2"):
        raise extras.MissingPackageError(why)
    from smc_mujoco.evidence.report import page

    folder = Path(out)
    with bar("claims", shown=progress, counted=True) as shown:
        done = audit(paper, quick=quick, threads=threads, report=shown.reached)
    document = evidence.document(done)
    write_json(folder / "evidence.json", document)
    about = done.paper
    read = []
    for words in (f"Read: {about.read}.", about.access, about.note):
        if words:
            read.append(page.text(words))
    seal = f"{len(document['runs'])} runs. evidence.json, beside this file, leads from each claim"
    seal += f" to its runs, numbers and verdict. Its seal is {document['seal'][:16]}…;"
    seal += " smc-mujoco claims --check evidence.json checks it."
    return page.write(
        folder / "report.html",
        title=about.title,
        over=f"{len(done.claims)} claims of a paper, measured" + (", quickly" if quick else ""),
        about=f"{about.authors}, {about.source}",
        made_by=f"smc-mujoco report --paper {about.name}{' --quick' if quick else ''}",
        sections=[
            page.Section("claims", "The claims", [*read, page.claims(done.claims)]),
            page.Section("gains", "Gains", page.tables(gains(done))),
            page.Section("method", "How it was computed", [page.text(VERDICTS), page.text(seal)]),
        ],
    )


def gains(done: Audit) -> list[Tabular]:
    """Return a table for each set of gains: the laws of its runs, their gains, and on which
    plants.
    """
    tables = []
    for name in done.claims[0].verdicts:
        plants: dict[tuple[str, str], dict[str, None]] = {}
        for by_set in done.used.values():
            for run in by_set.get(name, {}).values():
                law = run.scenario.law
                values = ", ".join(f"{gain} = {size:.3g}" for gain, size in law.gains.items())
                plants.setdefault((law.name, values), {})[run.scenario.plant.name] = None
        rows = [(law, values, ", ".join(on)) for (law, values), on in sorted(plants.items())]
        heads = ["law", "gains", "on"]
        tables.append(Tabular(headings=heads, rows=rows, title=f"{name} gains", left=3))
    return tables
