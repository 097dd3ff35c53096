"""smc-mujoco certify: what is proven of a law on a plant."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Terminal
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.interrupts import delay_ctrl_c
from smc_mujoco.common.text import capital

if TYPE_CHECKING:
    from smc_mujoco.evidence.certificates.certificate import Certificate
    from smc_mujoco.simulation.scenario import Scenario
    from smc_mujoco.studies.worst_case import WorstCase

METRIC = "ultimate_bound"  # largest |x| in the last fifth of a run


def certify(
    ctx: typer.Context,
    plant: Annotated[
        str | None,
        typer.Argument(
            metavar="PLANT", autocompletion=options.PLANTS, help="A plant from `smc-mujoco list`."
        ),
    ] = None,
    law: options.OneLaw = "observer_free",
    disturbance: options.Disturbance = None,
    slope: Annotated[
        float | None, typer.Option(min=0.0, help="Bound on |d'|, per s; default: d may jump.")
    ] = None,
    condition: options.Condition = "nominal",
    gains: options.Gains = "tuned",
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Also write the certificate to a file.")
    ] = None,
    figure: Annotated[
        Path | None,
        options.picture("the state plane, with the worst run found within --disturbance"),
    ] = None,
    worst: Annotated[
        bool, typer.Option("--worst", help="Also find the worst d, as for a figure.")
    ] = False,
    check: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.json",
            help="Instead, prove the certificate in a file again; without plant, law, gains.",
        ),
    ] = None,
    json: options.Json = None,
) -> None:
    """Prove what a law does on a plant: from where it comes to rest, and how far a bounded
    disturbance pushes it.

    The plant is its equation, integrated exactly, and the law acts at every instant. The command
    prints each theorem with its conditions and their margins, also where they fail. No theorem is
    about sampling, delay, noise or dry friction. A separate checker proves
    it in ball arithmetic before it is shown; --check runs that checker again, with exit code 2 if a
    statement is not proven.

    Example: smc-mujoco certify duffing --law observer_free --disturbance 2 --out duffing.json
    --figure duffing.png

    Example: smc-mujoco certify --check duffing.json
    """
    with delay_ctrl_c():
        from smc_mujoco.draw.page import files
        from smc_mujoco.evidence.certificates.certificate import Certificate
        from smc_mujoco.evidence.commands import tables
        from smc_mujoco.simulation.run import run

    terminal = Terminal(json)
    pictures = files(figure)
    options.check_files(out, *pictures)
    scenario = worst_run = None
    if check:
        asked = ("plant", "law", "disturbance", "slope", "condition", "gains", "worst")
        options.only_for(ctx, asked, False, "a new certificate: leave it out beside --check")
        made = Certificate.load(check)
        made.check()
        terminal.note(f"{check}: every statement is proven", "bold")
    elif plant:
        scenario, made, worst_run = _certified(
            plant, law, condition, gains, disturbance, slope, worst, bool(figure)
        )
    else:
        raise ScenarioError("give a plant, such as duffing, or --check FILE.json")
    terminal.print(tables.certificate(made))
    for sentence in made.sentences:
        terminal.note(f"{capital(sentence)}.", "bold", wrap=True)
    if worst_run:
        end = f"it ends in |x| = {worst_run.value:.3g} {made.data['unit']}"
        terminal.note(f"Worst found in {worst_run.tried} runs of this machine: {end}.", "bold")
    if out:
        terminal.wrote(made.save(out))
    if figure:
        shown = worst_run.scenario if worst_run else scenario
        if shown and shown.plant.n == 1:
            traces = run([shown])
        else:
            traces = ()
        made.figure(figure, traces, worst_run.tried if worst_run else 0)
        terminal.wrote(*pictures)
    terminal.finish()


def _certified(
    plant: str,
    law: str,
    condition: str,
    gains: str,
    disturbance: float | None,
    slope: float | None,
    worst: bool,
    drawn: bool,
) -> "tuple[Scenario, Certificate, WorstCase | None]":
    """Return a scenario, its certificate and, if `worst` or `drawn`, the worst case within its
    bounds.
    """
    from smc_mujoco.analysis.worst_case.uncertainty import Uncertainty
    from smc_mujoco.control import gain_sets
    from smc_mujoco.evidence.certificates.maker import certify as make
    from smc_mujoco.mechanisms.named import jointed
    from smc_mujoco.simulation.grid import case
    from smc_mujoco.studies.worst_case import worst_case

    machine = jointed(plant, "a theorem")
    chosen = options.law(law)
    if isinstance(chosen, str) and gain_sets.in_set(machine, chosen, gains):
        chosen = gain_sets.law(
            machine, chosen, gains
        )  # the best of the searches, where run i has those of search i
    scenario = case(machine, chosen, condition, gains=gains)
    if disturbance:
        within = Uncertainty(disturbance=disturbance, slope=slope)
    else:
        within = None
    if worst and within is None:
        raise ScenarioError("--worst needs a bound to search within: give --disturbance")
    made = make(scenario, within)
    attacked = within and (worst or (drawn and machine.n == 1))
    return scenario, made, worst_case(scenario, METRIC, within, progress=True) if attacked else None
