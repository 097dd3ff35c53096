"""smc-mujoco margins: how much delay, disturbance, friction, mass and noise each law bears."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from smc_mujoco.cli.commands import asked
from smc_mujoco.cli.terminal import Clock, loading, mendable, wrote

if TYPE_CHECKING:
    from rich.table import Table

    from smc_mujoco.analysis.margins import Margin

QUICK = {"plants": ["inverted_pendulum", "duffing"], "kinds": ["delay", "disturbance"]}


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
        str | None, typer.Option(help=f"Laws, as a,b; default those of the report's first page. {asked.OWN_GAINS}")
    ] = None,
    kinds: Annotated[
        str | None, typer.Option(help="Of delay,disturbance,friction,mass,noise, as a,b; default all.")
    ] = None,
    gains: Annotated[str, typer.Option(help="Whose gains: tuned, study, tracking or default.")] = "tuned",
    quick: Annotated[
        bool, typer.Option("--quick", help="Shorter runs, coarser; by default 2 plants, 4 laws, delay and disturbance.")
    ] = False,
    condition: asked.During = "nominal",
    x0: asked.Middle = None,
    json: Annotated[Path | None, typer.Option(help="Also write the margins to a .json file.")] = None,
    threads: Annotated[int | None, typer.Option(min=1, help="Simulations at once; default one per core.")] = None,
) -> None:
    """Find how much a law bears: the largest level with which the error still ends below 5 % of the first.

    Constant disturbance and dry friction in N or N m, mass as a multiple of the nominal one, noise as the standard
    deviation of the position (the velocity's is 5/s of it), delay of the command in s. Theory is that of the loop
    linearised at rest, for laws that have one: for a delay, where rest turns unstable; a law may bear more, in a small
    steady oscillation. The search and its limits: smc_mujoco.analysis.margins.

    Example: smc-mujoco margins duffing --laws observer_free,classical --kinds delay
    """
    with mendable():
        with loading():
            from rich.console import Console

            from smc_mujoco.analysis.margins import KINDS, save
            from smc_mujoco.analysis.margins import margins as search
            from smc_mujoco.common.files import ended, writable
            from smc_mujoco.common.progress import bar
            from smc_mujoco.control import gain_sets as sets
            from smc_mujoco.studies.paper import scenarios

        clock, console = Clock(), Console()
        if json:
            writable(ended(json, ".json"))
        chosen = plants or (QUICK["plants"] if quick else scenarios.PLANTS)
        borne_by = asked.laws(asked.names(laws, scenarios.LAWS if quick else sets.LAWS))
        kind = asked.names(kinds, QUICK["kinds"] if quick else KINDS)
        with clock("in all"), bar("margins") as drawn:
            machines, around = asked.plants(chosen), asked.starts(x0, None)
            found = search(machines, borne_by, kind, gains, quick, threads, drawn.reached, condition, around)
        for name in kind:
            console.print(table(name, [margin for margin in found if margin.kind == name]))
        said = f"{len(found)} margin{'s' * (len(found) != 1)}, {asked.origin(borne_by, gains)}"
        said += f", {clock.spent['in all']:.0f} s"
        console.print(said, style="dim", soft_wrap=True, highlight=False)
        if json:
            wrote(console, save(found, json))


def table(kind: str, found: "list[Margin]") -> "Table":
    """The margins of one kind: a line a plant and law."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from smc_mujoco.cli.tables import number
    from smc_mujoco.draw.style import law_colour

    made = Table(title=f"largest {kind} borne", title_justify="left", title_style="bold", box=box.SIMPLE_HEAD)
    made.add_column("plant")
    made.add_column("law")
    for head in ("margin", "to within", "theory"):
        made.add_column(head, justify="right", no_wrap=True)
    made.add_column("unit")
    last = None
    for margin in found:
        value = "none" if margin.value != margin.value else f"{'>= ' * margin.open}{number(margin.value)}"
        theory = "" if margin.theory is None else "any" if margin.theory == float("inf") else number(margin.theory)
        plant = "" if margin.plant == last else margin.plant
        law = Text(margin.law, style=law_colour(margin.law))
        within = number(margin.resolution) if margin.resolution else ""
        made.add_row(plant, law, value, within, theory, margin.unit)
        last = margin.plant
    return made
