"""smc-mujoco claims: audits of the claims of papers."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.console import Terminal, importing

if TYPE_CHECKING:
    from smc_mujoco.evidence.audit.paper import Paper as AuditedPaper

Ids = Annotated[
    list[str] | None,
    typer.Argument(metavar="ID", help="Claims, such as 3 18; default: all.", show_default=False),
]
Gains = Annotated[
    str | None,
    typer.Option(help="Sets of gains, separated by commas; default: all of the paper's."),
]
Quick = Annotated[
    bool, typer.Option("--quick", help="Coarser grids and shorter runs; one set of gains.")
]
Paper = Annotated[
    str | None,
    typer.Option(metavar="NAME|FOLDER", help="A paper of --papers; default Gaber's."),
]
Evidence = Annotated[
    Path | None,
    typer.Option(metavar="FILE.json", help="Also write runs, numbers and verdicts, sealed."),
]
Listed = Annotated[
    bool, typer.Option("--list", help="List the claims with their sentences instead.")
]
New = Annotated[
    Path | None,
    typer.Option("--new", metavar="FOLDER", help="Write a template of your own paper instead."),
]
Check = Annotated[
    Path | None,
    typer.Option(metavar="FILE.json", help="Check the seal of a file of --evidence instead."),
]


def claims(
    ctx: typer.Context,
    ids: Ids = None,
    gains: Gains = None,
    quick: Quick = False,
    paper: Paper = None,
    json: options.Json = None,
    evidence: Evidence = None,
    threads: options.Threads = None,
    listed: Listed = False,
    papers: Annotated[bool, typer.Option("--papers", help="List the papers instead.")] = False,
    new: New = None,
    check: Check = None,
    full: options.Full = False,
) -> None:
    """Audit a paper's claims: test each against a threshold that was fixed before any run.

    A paper is a folder. Its paper.toml has the claims and their thresholds, and its claims.py has a
    function for each claim.

    Under a set of gains a claim is supported if all its sentences hold, refuted if none does, and
    partly supported otherwise. One counter-example refutes a universal claim. A claim about some
    gains is "not shown" if a search finds no example. Claims that you name are shown in full. By
    default all of Gaber's are measured, which takes minutes.

    A second audit with the same versions writes the same file of --evidence, to the last bit.

    Example: smc-mujoco claims --list

    Example: smc-mujoco claims 3 18 --gains tuned

    Example: smc-mujoco claims --new my_paper

    Example: smc-mujoco claims --paper ./my_paper --evidence evidence.json
    """
    if papers or new or check:
        audited = ("ids", "gains", "quick", "paper", "evidence", "threads")
        options.only_for(ctx, audited, False, "audits: leave out --papers, --new and --check")
        _papers(papers, new, check, Terminal(json))
        return
    with importing():
        from smc_mujoco.common.files import with_ending, writable
        from smc_mujoco.common.progress import bar
        from smc_mujoco.evidence.audit.audit import DEFAULT_PAPER, audit, document
        from smc_mujoco.evidence.audit.paper import paper as find_paper
        from smc_mujoco.evidence.commands import claim_tables

    terminal = Terminal(json)
    about = find_paper(paper or DEFAULT_PAPER)
    if listed:
        _list_claims(about, terminal)
        return
    sets = None if gains is None else options.parsed_names(gains)
    writable(evidence and with_ending(evidence, ".json"))
    with bar("claims") as drawn:
        done = audit(about, ids or None, sets, quick, threads, report=drawn.reached)
    if evidence:
        evidence = done.save(evidence)
    claim_tables.print_claims(done.claims, terminal, bool(ids), full)
    _finish(document(done.claims), quick, evidence, terminal)


def _list_claims(paper: "AuditedPaper", terminal: Terminal) -> None:
    """Print the claims of a paper, and end the command."""
    from smc_mujoco.common.tabular import of_fields

    texts = {id: claim.text for id, claim in paper.claims.items()}
    terminal.print(of_fields(f"{paper.authors}: {paper.title}", texts))
    terminal.finish()


def _finish(claims: Any, quick: bool, evidence: Path | None, terminal: Terminal) -> None:
    """Print how long the audit took and where its evidence is, and end the command."""
    terminal.note(f"{terminal.seconds:.0f} s", "dim")
    if quick:
        terminal.note("quick: coarser grids than the claims say, and fewer sets of gains", "dim")
    if evidence:
        terminal.wrote(evidence)
    terminal.finish(claims)


def _papers(listed: bool, new: Path | None, check: Path | None, terminal: Terminal) -> None:
    """Begin a paper of one's own, check evidence, or list the papers."""
    with importing():
        from smc_mujoco.cli import tables
        from smc_mujoco.common.tabular import of_fields
        from smc_mujoco.evidence.audit import evidence, paper

    if new:
        terminal.wrote(*paper.new(new))
    if check:
        data = evidence.read_sealed(check)
        counted = []
        for verdict, count in data["counts"].items():
            counted.append(f"{count} {verdict}")
        counts = ", ".join(counted)
        about = f"{data['paper']['authors']}, {data['paper']['title']}"
        terminal.note(f"the seal is whole: {about}: {counts}", wrap=True)
    if listed:
        rows = {}
        for name, entry in paper.papers().items():
            line = f"{entry.authors}: {entry.title} ({entry.contents})"
            rows[name] = tables.with_package(line, paper.paper_catalogue().package(name))
        terminal.print(of_fields("Papers, for smc-mujoco claims --paper", rows))
    terminal.finish()
