"""smc-mujoco margins: how much delay, disturbance, friction, mass and noise each law tolerates."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Clock, loading, mendable, wrote

QUICK = {"plants": ["inverted_pendulum", "duffing"], "kinds": ["delay", "disturbance"]}


@mendable()
def margins(
    plants: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[PLANT]...",
            help="Names, or FILE.xml:joint+joint; the paper's without one.",
            show_default=False,
        ),
    ] = None,
    laws: Annotated[
        str | None, typer.Option(help=f"Laws, as a,b; default those of the report's first page. {options.OWN_GAINS}")
    ] = None,
    kinds: Annotated[
        str | None, typer.Option(help="Of delay,disturbance,friction,mass,noise, as a,b; default all.")
    ] = None,
    gains: options.Gains = "tuned",
    quick: Annotated[
        bool, typer.Option("--quick", help="Shorter runs, coarser; by default 2 plants, 4 laws, delay and disturbance.")
    ] = False,
    condition: options.During = "nominal",
    x0: options.Middle = None,
    json: Annotated[Path | None, typer.Option(help="Also write the margins to a .json file.")] = None,
    threads: options.Threads = None,
) -> None:
    """Find how much a law tolerates: the largest level with which the error still ends below 5 % of the first.

    Constant disturbance and dry friction in N or N m, mass as a multiple of the nominal one, noise as the standard
    deviation of the position (the velocity's is 5/s of it), delay of the command in s. Theory is that of the loop
    linearised at rest, for laws that have one: for a delay, where rest turns unstable; a law may tolerate more, in a
    small steady oscillation. The search and its limits: smc_mujoco.analysis.margins.

    Example: smc-mujoco margins duffing --laws observer_free,classical --kinds delay
    """
    with loading():
        from rich.console import Console

        from smc_mujoco.analysis.margins import KINDS, save
        from smc_mujoco.analysis.margins import margins as search
        from smc_mujoco.cli import tables
        from smc_mujoco.common.files import ended, writable
        from smc_mujoco.common.progress import bar
        from smc_mujoco.control import gain_sets as sets
        from smc_mujoco.studies.paper import scenarios

    clock, console = Clock(), Console()
    if json:
        writable(ended(json, ".json"))
    chosen = plants or (QUICK["plants"] if quick else scenarios.PLANTS)
    own = [options.law(text) for text in options.names(laws, scenarios.LAWS if quick else sets.LAWS)]
    kind = options.names(kinds, QUICK["kinds"] if quick else KINDS)
    with clock("in all"), bar("margins") as drawn:
        machines, around = [options.plant(text) for text in chosen], options.starts(x0, None)
        found = search(machines, own, kind, gains, quick, threads, drawn.reached, condition, around)
    for name in kind:
        console.print(tables.margins(name, [margin for margin in found if margin.kind == name]))
    said = f"{len(found)} margin{'s' * (len(found) != 1)}, {options.origin(own, gains)}"
    said += f", {clock.spent['in all']:.0f} s"
    console.print(said, style="dim", soft_wrap=True, highlight=False)
    if json:
        wrote(console, save(found, json))
