"""smc-mujoco which, bench, board, claims, papers, report: questions that many runs of many laws answer."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Terminal, errors_as_sentences
from smc_mujoco.common.errors import printable
from smc_mujoco.common.interrupts import held_back

if TYPE_CHECKING:
    from smc_mujoco.simulation.initial_states import Starts
    from smc_mujoco.simulation.scenario import Scenario
    from smc_mujoco.studies.study import Extent


@errors_as_sentences()
def which(
    plant: options.PlantName,
    needs: Annotated[
        str | None,
        typer.Option(
            help="What to compare, as a,b: fast, accurate, on-track, calm, gentle, frugal, no-overshoot; default "
            "fast,accurate,calm. And what the law must have: no-velocity, continuous, two-gains, finite-time, ..., "
            "as for `smc-mujoco laws --needs`."
        ),
    ] = None,
    condition: options.Conditions = None,
    conditions: Annotated[
        str | None,
        typer.Option(help="Conditions from `smc-mujoco list`, as a,b; default nominal,noise,sine."),
    ] = None,
    laws: Annotated[str | None, typer.Option(help=f"Laws, as a,b; default all that suit. {options.OWN_GAINS}")] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer starts and finalists, shorter runs, a third of each tuning.")
    ] = False,
    seeds: Annotated[
        int | None,
        typer.Option(
            min=1, help="Starts and noises of the finals; default 24, --quick 16. With fewer than 16 no law can win."
        ),
    ] = None,
    duration: Annotated[float | None, typer.Option(help="Duration of a run, s; default 5, with --quick 3.")] = None,
    x0: options.X0 = None,
    spread: options.Spread = None,
    out: Annotated[Path, typer.Option(help="Folder for gains and runs; a later call reuses them.")] = Path("which"),
    threads: options.Threads = None,
) -> None:
    """Advise a law for a plant: which to use, with which gains, why, the second choice, and how sure that is.

    All laws that suit are compared, with gains that were tuned for the plant by one rule: those of the package, or else
    found now, which takes some seconds for each law. A first round with few starts selects the finalists. They run from
    new starts and noises, and are compared by the rules of `bench`: a law is better only if its median is lower by more
    than 3 % and a test over the starts, corrected for all comparisons, confirms it. If no law is better than another,
    the answer says so. If you stop the command, it continues when you start it again.

    Example: smc-mujoco which duffing --conditions noise,coulomb --needs calm,fast

    Example: smc-mujoco which arm.xml:shoulder --x0 0.5 --condition "worn: sensor=Encoder(counts=4096)" --needs accurate
    """
    with held_back():
        from smc_mujoco.cli import tables
        from smc_mujoco.studies.adviser import which as advise

    terminal = Terminal()
    asked = options.conditions(options.names(conditions), condition) if conditions or condition else None
    advice = advise(
        options.plant(plant),
        asked,
        options.names(needs),
        None if laws is None else [options.law(text) for text in options.names(laws)],
        seeds,
        duration,
        options.starts(x0, spread),
        out,
        quick,
        threads,
        progress=True,
    )
    terminal.print(tables.advice(advice))
    for sentence in advice.answer:
        terminal.print()
        terminal.note(sentence, wrap=True)
    runs = f"{len(advice.table)} runs of the finalists are in {printable(str(out / 'finals' / 'results.parquet'))}"
    terminal.print()
    if advice.code:
        terminal.note(f"In Python: {advice.code}", wrap=True)
        terminal.print()
    terminal.note(f"{runs}; {terminal.seconds:.0f} s", "dim")


@errors_as_sentences()
def bench(
    quick: Annotated[
        bool,
        typer.Option(
            "--quick", help="A small study: 3 plants, 3 conditions, 16 seeds, 3 s a run; half a minute on 2 cores."
        ),
    ] = False,
    plants: Annotated[
        str | None, typer.Option(help="Plants, as a,b or FILE.xml:joint+joint; default the paper's five.")
    ] = None,
    laws: Annotated[
        str | None,
        typer.Option(help=f"Laws, as a,b, or all; default those of the report's first page. {options.OWN_GAINS}"),
    ] = None,
    conditions: Annotated[
        str | None,
        typer.Option(help="Conditions, as a,b; default up to 12 that suit the plants, none with --condition."),
    ] = None,
    condition: options.Conditions = None,
    x0: options.X0 = None,
    spread: options.Spread = None,
    seeds: Annotated[
        int | None,
        typer.Option(
            min=1, help="Number of starts and noises; default 20, --quick 16. With fewer than 16 no law can win."
        ),
    ] = None,
    gains: Annotated[
        str | None, typer.Option(help="Set of gains: tuned, study, tracking or default; by default tuned.")
    ] = None,
    duration: Annotated[float | None, typer.Option(help="Duration of a run, s; default 10, --quick 3.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("study"),
    executor: Annotated[str, typer.Option(help="local, or dask://HOST:PORT of a scheduler.")] = "local",
    traces: Annotated[
        str, typer.Option(help="Traces to save: none, all, or worst (the worst run per plant and condition).")
    ] = "none",
    fresh: Annotated[bool, typer.Option("--fresh", help="Discard the runs that are in the folder.")] = False,
    rig: Annotated[
        str | None,
        typer.Option(help="A real machine, with its parameter sets, in place of plants, conditions and gains."),
    ] = None,
    threads: options.Threads = None,
) -> None:
    """Compare laws on plants in conditions: run every combination from every seed, to OUT/results.parquet.

    Finished runs are kept: you can stop the command at any time, and continue by starting it again with the same
    options. The table has only the runs of the last command, so give each study its own --out. `smc-mujoco list` shows
    laws and conditions. --laws all compares every general law that has gains for these plants in the set of --gains;
    the set default has gains for all laws. The leaderboard names the winner under each condition, and over all of them.
    With --rig the machine's parameter sets take the place of the conditions, and a line for each metric says if one
    law wins on all of them.

    Example: smc-mujoco bench --plants duffing --conditions noise,coulomb --seeds 16 --out duffing
    """
    with held_back():
        from smc_mujoco.cli import tables
        from smc_mujoco.common.errors import ScenarioError
        from smc_mujoco.studies.leaderboard import leaderboard
        from smc_mujoco.studies.study import FULL, QUICK, study
        from smc_mujoco.evidence.rigs import ensemble
        from smc_mujoco.evidence.rigs.rig import rig as find_rig

    terminal, size = Terminal(), QUICK if quick else FULL
    count, length = seeds or size.seeds, size.duration if duration is None else duration
    begin = options.starts(x0, spread)
    if rig is not None:
        if plants or conditions or condition or gains:
            raise ScenarioError(
                "--rig brings its own plant, parameter sets and gains: leave out --plants, --conditions, "
                "--condition and --gains"
            )
        chosen = None if laws is None else [options.law(text) for text in options.names(laws)]
        scenarios = ensemble.runs(find_rig(rig), chosen, count, "default", length, begin)
        used = options.gains_used(chosen or (), "default")
    else:
        scenarios, used = _grid(size, plants, laws, conditions, condition, count, gains or "tuned", length, begin)
    table = study(scenarios, out, not fresh, executor, threads, progress=True, traces=traces)
    boards = leaderboard(table)
    terminal.print(tables.leaderboard(boards))
    if rig is not None:
        terminal.note(ensemble.verdict(boards))
    failed = len(table) - table.data["failure"].null_count
    runs = f"{len(table)} run{'s' * (len(table) != 1)}, {failed} of them failed"
    terminal.note(f"{runs}, {used}, {terminal.seconds:.0f} s")
    terminal.wrote(out / "results.parquet")


def _grid(
    size: "Extent",
    plants: str | None,
    laws: str | None,
    conditions: str | None,
    own: list[str] | None,
    seeds: int,
    gains: str,
    duration: float,
    starts: "Starts | None",
) -> "tuple[list[Scenario], str]":
    """Return the scenarios of `bench` from the texts of its options, and in words where their gains are from."""
    from smc_mujoco.control.gain_sets import general_laws
    from smc_mujoco.mechanisms.plant import as_plant
    from smc_mujoco.simulation.conditions import applicable
    from smc_mujoco.simulation.grid import grid

    machines = [options.plant(text) for text in options.names(plants, size.plants)]
    usual = () if own else applicable(size.conditions, [as_plant(plant) for plant in machines], duration)
    chosen = options.names(laws, size.laws)
    chosen = general_laws(machines, gains) if laws == "all" else [options.law(text) for text in chosen]
    found = options.conditions(options.names(conditions, usual), own)
    return grid(machines, chosen, found, seeds, gains, duration, starts), options.gains_used(chosen, gains)


@errors_as_sentences()
def board(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="acrobot or pendubot.")],
    robustness: Annotated[
        bool, typer.Option(help="Whether to run the robustness test too: 722 machines, some 10 s.")
    ] = True,
    figure: Annotated[Path | None, typer.Option(help="Also draw the run, as FIGURE.svg and FIGURE.png.")] = None,
    film: Annotated[Path | None, typer.Option(help="Also film the run, to a .mp4 file.")] = None,
) -> None:
    """Show RealAIGym's board of a robot, with this package's sliding-mode entry among the published rows.

    The task: swing the double pendulum up from rest and balance it, with one motor of 6 N m at the shoulder (pendubot)
    or at the elbow (acrobot), in 10 s. Less is better in every criterion, more in the score. For your own law use
    smc.boards, see docs/boards.md.

    Example: smc-mujoco board acrobot --figure acrobot --film acrobot.mp4
    """
    with held_back():
        from smc_mujoco.cli import tables
        from smc_mujoco.cli.scene import filmed
        from smc_mujoco.common.errors import ScenarioError
        from smc_mujoco.common.files import writable
        from smc_mujoco.common.progress import bar
        from smc_mujoco.simulation.run import run
        from smc_mujoco.evidence import boards

    terminal = Terminal()
    scenario = boards.entry(robot)
    if figure:
        writable(figure)
    if film:
        if film.suffix != ".mp4":
            raise ScenarioError(f"cannot film to {film.name!r}: end the name in .mp4")
        writable(film)
    trace, found = run(scenario), None
    terminal.print(tables.board(robot, boards.board(trace), boards.NAME))
    if robustness:
        with bar(f"robustness of {robot}") as drawn:
            found = boards.robustness(scenario, drawn.reached)
        terminal.print(tables.board(robot, boards.robustness_board(robot, found), boards.NAME))
    terminal.note(f"{boards.verdict(robot, trace, found)}.\n", "bold", wrap=True)
    terminal.note(f"published rows: {boards.SOURCE}; {terminal.seconds:.0f} s", "dim", wrap=True)
    title = f"{robot.capitalize()}: swing-up and balance"
    if figure:
        from smc_mujoco.draw.figure import figure as draw
        from smc_mujoco.draw.page import files

        draw([trace], figure, title=title)
        terminal.wrote(*files(figure))
    if film:
        terminal.wrote(*filmed([trace], film, None, title, terminal))


@errors_as_sentences()
def claims(
    ids: Annotated[
        list[str] | None,
        typer.Argument(metavar="ID", help="Numbers of claims, as 3 18; by default all.", show_default=False),
    ] = None,
    gains: Annotated[str | None, typer.Option(help="Sets of gains, as a,b; default all of the paper's.")] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Coarser grids and shorter runs, as each claim says; one set of gains.")
    ] = False,
    paper: Annotated[
        str | None,
        typer.Option(metavar="NAME|FOLDER", help="A paper of `smc-mujoco papers`, or a folder; default Gaber's."),
    ] = None,
    table: Annotated[
        Path | None, typer.Option(help="results.parquet of `smc-mujoco bench`; its runs are not repeated.")
    ] = None,
    json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document instead of tables, like --json - elsewhere.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Also write that JSON document to a file.")] = None,
    evidence: Annotated[
        Path | None,
        typer.Option(metavar="FILE.json", help="Also write claims, runs, numbers, thresholds and verdicts, sealed."),
    ] = None,
    badge: Annotated[
        Path | None, typer.Option(metavar="FILE.svg", help="Also write a badge with the number of claims by verdict.")
    ] = None,
    mutants: Annotated[
        bool,
        typer.Option(
            "--mutants",
            help="Check that the audit can fail: list claims that no broken law loses. Exit code 1 if there are any.",
        ),
    ] = False,
    threads: options.Threads = None,
) -> None:
    """Audit a paper's claims: measure each against the threshold that was fixed for it before any run.

    Under a set of gains a claim is supported if all its sentences hold, refuted if none does, and partly supported
    otherwise. If the verdict depends on the set of gains, the table says so. One counter-example refutes a universal
    claim. Claims that you name are shown in full, with every check. All of Gaber's, the default, take minutes.

    The file of --evidence has the hashes of each claim's runs, their numbers, thresholds and verdicts, and a seal. A
    second audit with the same versions writes the same file, to the last bit.

    Example: smc-mujoco claims 3 18 --gains tuned

    Example: smc-mujoco claims --paper ./my_paper --evidence evidence.json --badge badge.svg
    """
    with held_back():
        from smc_mujoco.cli import tables
        from smc_mujoco.common.errors import ScenarioError
        from smc_mujoco.common.files import ended, replacing, writable
        from smc_mujoco.common.progress import bar
        from smc_mujoco.evidence.audit.audit import DEFAULT, audit, document, evaluations
        from smc_mujoco.evidence.audit.paper import paper as find_paper
        from smc_mujoco.studies.table import Table
        from smc_mujoco.testing import mutants as testing

    terminal = Terminal()
    about = find_paper(paper or DEFAULT)
    sets = None if gains is None else options.names(gains)
    known = None if table is None else Table.read(table)
    if evidence and known:
        raise ScenarioError("--evidence needs runs that the audit makes itself: leave out --table")
    if mutants and json:
        raise ScenarioError("--mutants prints sentences: leave out --json")
    for file, ending in ((out, ""), (evidence, ".json"), (badge, ".svg")):
        if file:
            writable(ended(file, ending) if ending else file)
    with bar("claims", evaluations(ids or None, sets, quick, about), counted=True) as drawn:
        done = audit(about, ids or None, sets, quick, threads, table=known, report=drawn.advance)
    found = done.claims
    written = [one for one in (evidence and done.save(evidence), badge and done.badge(badge)) if one]
    text = document(found)
    if out:
        with replacing(out) as file:
            file.write_text(text + "\n", encoding="utf-8")
        written.append(out)
    if json:
        print(text)
        return
    tables.print_claims(found, terminal, full=bool(ids))
    kept: dict[str, str] = {}
    if mutants:
        with bar("mutants", testing.evaluations(about, ids or None, sets, quick), counted=True) as drawn:
            kept = testing.survivors(about, ids or None, sets, quick, threads, drawn.advance)
        terminal.note(
            "\n".join(
                [f"claim {id} is {why}" for id, why in kept.items()]
                or ["Every claim is lost by a mutant of its law, or says why it cannot be."]
            )
        )
        asked = [about.claims[claim.id] for claim in found]
        for entry in [entry for entry in asked if entry.immune]:
            terminal.note(f"claim {entry.id} cannot be lost: {entry.immune}", wrap=True)
    notes = [f"{terminal.seconds:.0f} s", "quick: coarser grids than the claims say" * quick]
    notes.append(f"wrote {printable(', '.join(map(str, written)))}" if written else "")
    terminal.note("; ".join(filter(None, notes)), "dim")
    if kept:
        raise SystemExit(1)


@errors_as_sentences()
def papers(
    new: Annotated[
        Path | None,
        typer.Option("--new", metavar="FOLDER", help="Write a template of your own paper into a folder."),
    ] = None,
    check: Annotated[
        Path | None,
        typer.Option(metavar="FILE.json", help="Check the seal of a file that `smc-mujoco claims --evidence` wrote."),
    ] = None,
) -> None:
    """List the papers whose claims `smc-mujoco claims --paper NAME` audits, begin your own, or check evidence.

    A paper is a folder with paper.toml, its claims and their thresholds, and claims.py, a function for each claim.

    Example: smc-mujoco papers --new my_paper && smc-mujoco claims --paper ./my_paper
    """
    with held_back():
        from smc_mujoco.cli import tables
        from smc_mujoco.evidence.audit import evidence, paper

    terminal = Terminal()
    if new:
        terminal.wrote(*paper.new(new))
    if check:
        data = evidence.check(check)
        counts = ", ".join(f"{count} {verdict}" for verdict, count in data["counts"].items())
        terminal.note(f"the seal is whole: {data['paper']['authors']}, {data['paper']['title']}: {counts}", wrap=True)
    if new or check:
        return
    lines = {name: f"{one.authors}: {one.title} ({len(one.claims)} claims)" for name, one in paper.papers().items()}
    rows = [(name, tables.with_package(line, paper.catalogue().package(name))) for name, line in lines.items()]
    terminal.print(tables.catalogue("Papers, for smc-mujoco claims --paper", rows))


@errors_as_sentences()
def report(
    quick: Annotated[bool, typer.Option("--quick", help="A small report, in two minutes: less of everything.")] = False,
    out: Annotated[Path, typer.Option(help="Folder for the report and its data.")] = Path("report"),
    seeds: Annotated[
        int | None, typer.Option(min=1, help="Seeds of every cell of the grid. With fewer than 16 no law can win.")
    ] = None,
    records: Annotated[
        Path | None,
        typer.Option(help="Folder with records of rigs, CSV or npz, which are shown beside their twins; see identify."),
    ] = None,
    laws: Annotated[
        str | None,
        typer.Option(help="Further laws, as a,b, beside the study's; each needs tuned gains on the study's plants."),
    ] = None,
    paper: Annotated[
        str | None,
        typer.Option(metavar="NAME|FOLDER", help="Instead of the study, audit a paper of `smc-mujoco papers`."),
    ] = None,
    threads: options.Threads = None,
) -> None:
    """Compute the whole study, in about 20 minutes, and write it as one HTML file: which controller, where, how sure.

    The report has the grid of plants, laws, conditions and seeds; the paper's claims; margins; regions of attraction;
    real machines; films. The file OUT/report.html needs no network and no other file; the data are in the same folder.
    You can stop the command at any time, and continue by starting it again.

    With --paper it is the audit of a paper, and takes seconds or minutes: OUT has report.html, evidence.json, badge.svg
    and checks.svg.

    Example: smc-mujoco report --quick --out look

    Example: smc-mujoco report --paper ./my_paper --out audit
    """
    with held_back():
        from smc_mujoco.common.errors import ScenarioError
        from smc_mujoco.evidence.report import paper as of_paper
        from smc_mujoco.evidence.report import report as make

    if paper and (seeds or records or laws):
        raise ScenarioError("--seeds, --laws and --records belong to the study: leave them out with --paper")
    if paper:
        path = of_paper.report(paper, out, quick, threads, progress=True)
    else:
        path = make(out, quick, seeds, threads, progress=True, records=records, laws=options.names(laws))
    print(f"wrote {printable(str(path))} ({path.stat().st_size / 1e6:.1f} MB): open it in a browser")
