"""smc-mujoco which, bench: questions that many runs of many laws answer."""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Terminal, errors_as_sentences
from smc_mujoco.common.errors import printable
from smc_mujoco.common.interrupts import held_back

if TYPE_CHECKING:
    from smc_mujoco.control.law import Law
    from smc_mujoco.mechanisms.plant import Plant
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
        typer.Option(min=1, help="Runs of a law in each condition of the finals, each from another start; default 24."),
    ] = None,
    duration: Annotated[float | None, typer.Option(help="Duration of a run, s; default 5, with --quick 3.")] = None,
    x0: options.X0 = None,
    spread: options.Spread = None,
    relevant: options.Relevant = None,
    out: Annotated[Path, typer.Option(help="Folder for gains and runs; a later call reuses them.")] = Path("which"),
    defaults: options.Defaults = False,
    threads: options.Threads = None,
) -> None:
    """Advise a law for a plant: which to use, with which gains, why, the second choice, and how sure that is.

    All laws that suit are compared, with gains that were tuned for the plant by one rule: those of the package, or else
    found now, which takes some seconds for each law. A first round with few starts selects the finalists. They run from
    new starts and noises, and over all gains that their tuning may end with. They are compared by the rules of `bench`:
    a law is better only if its values are lower by more than the least relevant difference, in a paired test that is
    corrected for all comparisons. If no law is better than another, the answer says so. If you stop the command, it
    continues when you start it again.

    Example: smc-mujoco which duffing --conditions noise,coulomb --needs calm,fast

    Example: smc-mujoco which arm.xml:shoulder --x0 0.5 --condition "worn: sensor=Encoder(counts=4096)" --needs accurate
    """
    with held_back():
        from smc_mujoco.analysis.differences import RELEVANT
        from smc_mujoco.cli import tables
        from smc_mujoco.studies.adviser import which as advise

    terminal = Terminal()
    asked = options.conditions(options.names(conditions), condition) if conditions or condition else None
    advice = advise(
        options.plant(plant),
        asked,
        options.names(needs),
        None if laws is None else options.laws(laws),
        seeds,
        duration,
        options.starts(x0, spread),
        out,
        quick,
        threads,
        progress=True,
        defaults=defaults,
        relevant=RELEVANT if relevant is None else relevant,
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
            "--quick", help="A small study: 3 plants, 3 conditions, 24 seeds, 3 s a run; a minute on 2 cores."
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
        typer.Option(min=1, help="Runs of a law in each condition, each from another start; default 24."),
    ] = None,
    gains: Annotated[
        str | None, typer.Option(help="Set of gains: tuned, study, tracking or default; by default tuned.")
    ] = None,
    duration: Annotated[float | None, typer.Option(help="Duration of a run, s; default 10, --quick 3.")] = None,
    relevant: options.Relevant = None,
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
    defaults: options.Defaults = False,
    threads: options.Threads = None,
) -> None:
    """Compare laws on plants in conditions: run every combination from every seed, to OUT/results.parquet.

    Finished runs are kept: you can stop the command at any time, and continue by starting it again with the same
    options. The table has only the runs of the last command, so give each study its own --out. `smc-mujoco list` shows
    laws and conditions. --laws all compares every general law that has gains for these plants in the set of --gains;
    the set default has gains for all laws. The leaderboard names the winner under each condition, and over all of them,
    but none over laws with default gains, unless you ask for it with --defaults.
    With --rig the machine's parameter sets take the place of the conditions, and a line for each metric says if one
    law wins on all of them.

    Example: smc-mujoco bench --plants duffing --conditions noise,coulomb --out duffing
    """
    with held_back():
        from smc_mujoco.analysis.differences import RELEVANT
        from smc_mujoco.cli import tables
        from smc_mujoco.common import annexes
        from smc_mujoco.common.errors import ScenarioError
        from smc_mujoco.studies.leaderboard import leaderboard
        from smc_mujoco.studies.study import FULL, QUICK, study

    terminal, size, ensemble = Terminal(), QUICK if quick else FULL, None
    count, length = seeds or size.seeds, size.duration if duration is None else duration
    begin = options.starts(x0, spread)
    if rig is not None:
        if plants or conditions or condition or gains:
            raise ScenarioError(
                "--rig brings its own plant, parameter sets and gains: leave out --plants, --conditions, "
                "--condition and --gains"
            )
        chosen = None if laws is None else options.laws(laws)
        ensemble = annexes.module("smc_mujoco.evidence.rigs.ensemble", "--rig")
        machine = annexes.module("smc_mujoco.evidence.rigs.rig", "--rig").rig(rig)
        scenarios = ensemble.runs(machine, chosen, count, "default", length, begin)
    else:
        scenarios = _grid(size, plants, laws, conditions, condition, count, gains, length, begin)
    table = study(scenarios, out, not fresh, executor, threads, progress=True, traces=traces)
    boards = leaderboard(table, defaults=defaults, relevant=RELEVANT if relevant is None else relevant)
    terminal.print(tables.leaderboard(boards))
    if ensemble:
        terminal.note(ensemble.verdict(boards))
    failed = len(table) - table.data["failure"].null_count
    runs = f"{len(table)} run{'s' * (len(table) != 1)}, {failed} of them failed"
    terminal.note(f"{runs}, {terminal.seconds:.0f} s")
    terminal.wrote(out / "results.parquet")


def _grid(
    size: "Extent",
    plants: str | None,
    laws: str | None,
    conditions: str | None,
    own: list[str] | None,
    seeds: int,
    gains: str | None,
    duration: float,
    starts: "Starts | None",
) -> "list[Scenario]":
    """Return the scenarios of `bench` from the texts of its options."""
    from smc_mujoco.control.gain_sets import general_laws
    from smc_mujoco.mechanisms.plant import as_plant
    from smc_mujoco.simulation.conditions import applicable
    from smc_mujoco.simulation.grid import grid

    machines = [options.plant(text) for text in options.names(plants, size.plants)]
    usual = () if own else applicable(size.conditions, [as_plant(plant) for plant in machines], duration)
    chosen = general_laws(machines, gains or "tuned") if laws == "all" else options.laws(laws, size.laws)
    found = options.conditions(options.names(conditions, usual), own)
    if gains is not None:
        return grid(machines, chosen, found, seeds, gains, duration, starts)
    known = {machine: _with_gains(machine, chosen, laws is None) for machine in machines}
    if all(laws == chosen for laws in known.values()):
        return grid(machines, chosen, found, seeds, "tuned", duration, starts)
    return [
        scenario
        for machine, laws_here in known.items()
        for scenario in grid(machine, laws_here, found, seeds, "tuned", duration, starts)
    ]


def _with_gains(plant: "str | Plant", laws: "Sequence[str | Law]", usual: bool) -> "list[str | Law]":
    """Return laws as they can run on a plant: those without tuned gains for it with their defaults, and a warning.

    Args:
      usual: whether the user named no laws: then those that are not for the plant are left out, with a note.

    Raises:
      ScenarioError: no law is for the plant.
    """
    from smc_mujoco.common.errors import ScenarioError
    from smc_mujoco.control.gain_sets import FORMS, has
    from smc_mujoco.control.law import fits
    from smc_mujoco.control.law import law as find_law
    from smc_mujoco.mechanisms.plant import as_plant

    machine, chosen, untuned, unfit = as_plant(plant), [], [], []
    for one in laws:
        if usual and isinstance(one, str) and not fits(find_law(one), machine):
            unfit.append(one)
        elif isinstance(one, str) and not has(machine, FORMS.get(one, one)):
            untuned.append(one)
            chosen.append(find_law(one))
        else:
            chosen.append(one)
    if not chosen:
        raise ScenarioError(f"none of the usual laws is for {machine.name}: name others, as --laws none")
    if unfit:
        warnings.warn(f"not for {machine.name}, and left out: {', '.join(unfit)}", UserWarning, 2)
    if untuned:
        warnings.warn(
            f"on {machine.name} these laws have their default gains, as none were tuned for it: {', '.join(untuned)}. "
            f"Tune each with smc-mujoco tune {machine.argument} LAW, or ask smc-mujoco which {machine.argument}",
            UserWarning,
            2,
        )
    return chosen
