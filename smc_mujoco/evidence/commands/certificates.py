"""smc-mujoco certify: what is proven of a law on a plant."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Terminal
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.interrupts import delay_signals
from smc_mujoco.common.text import capital

if TYPE_CHECKING:
    from smc_mujoco.evidence.certificates.certificate import Certificate


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
    condition: options.Condition = "nominal",
    gains: options.Gains = "tuned",
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Also write the certificate to a file.")
    ] = None,
    check: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.json",
            help="Instead, prove the certificate in a file again; without plant, law, gains.",
        ),
    ] = None,
    json: options.Json = None,
) -> None:
    """Prove a law's region of attraction on a plant, and its ultimate bound under a bounded
    disturbance.

    The plant is its equation, integrated exactly, and the law acts at every instant. The command
    prints each theorem with its conditions and their margins, also where they fail. No theorem is
    about sampling, delay, noise or dry friction. A separate checker proves
    each statement in ball arithmetic before it is shown; --check runs that checker again, with exit
    code 2 if a statement is not proven.

    Example: smc-mujoco certify duffing --law observer_free --disturbance 2 --out duffing.json

    Example: smc-mujoco certify --check duffing.json
    """
    with delay_signals():
        from smc_mujoco.evidence.certificates.certificate import Certificate
        from smc_mujoco.evidence.commands import tables

    terminal = Terminal(json)
    options.check_files(out)
    if check:
        asked = ("plant", "law", "disturbance", "condition", "gains")
        options.only_for(ctx, asked, False, "a new certificate: leave it out beside --check")
        made = Certificate.load(check)
        made.check()
        terminal.note(f"{check}: every statement is proven", "bold")
    elif plant:
        made = _certified(plant, law, condition, gains, disturbance)
    else:
        raise ScenarioError("give a plant, such as duffing, or --check FILE.json")
    terminal.print(tables.certificate(made))
    for sentence in made.sentences:
        terminal.note(f"{capital(sentence)}.", "bold", wrap=True)
    if out:
        terminal.wrote(made.save(out))
    terminal.finish()


def _certified(
    plant: str, law: str, condition: str, gains: str, disturbance: float | None
) -> "Certificate":
    """Return the certificate of a law with its gains of a set."""
    from smc_mujoco.control import gain_sets
    from smc_mujoco.evidence.certificates.maker import certify as make
    from smc_mujoco.mechanisms.named import jointed
    from smc_mujoco.robustness.uncertainty import Uncertainty
    from smc_mujoco.simulation.grid import case

    machine = jointed(plant, "a theorem")
    chosen = options.law(law)
    if isinstance(chosen, str) and gain_sets.in_set(machine, chosen, gains):
        # the best of the searches, where run i has those of search i
        chosen = gain_sets.law(machine, chosen, gains)
    scenario = case(machine, chosen, condition, gains=gains)
    return make(scenario, Uncertainty(disturbance=disturbance) if disturbance else None)
