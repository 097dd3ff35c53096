"""smc-mujoco basin: from which initial states a law brings a plant to rest."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Clock, loading, mendable, wrote


@mendable()
def basin(
    plant: Annotated[str, typer.Argument(metavar="PLANT", help="One that `list` shows, or FILE.xml:joint.")],
    law: Annotated[str, typer.Option(help=f"One that `laws` shows. {options.OWN_GAINS}")] = "observer_free",
    points: Annotated[int, typer.Option(min=2, help="Positions, and as many velocities.")] = 50,
    gains: options.Gains = "tuned",
    duration: Annotated[float, typer.Option(help="Of the longest runs, s.")] = 10.0,
    out: Annotated[Path | None, typer.Option(help="Also draw the map, to a .png or .svg file.")] = None,
    json: Annotated[Path | None, typer.Option(help="Also write the map to a .json file.")] = None,
    condition: options.During = "nominal",
    threads: options.Threads = None,
) -> None:
    """Map a region of attraction: run a grid of initial positions and velocities, and tell which come to rest at 0.

    Positions reach half a turn to either side, or on a rail twice the study's start; velocities three times that, per
    second. Channels of a network start alike. States leave as soon as they are decided, by the rule in
    smc_mujoco.analysis.region_of_attraction.

    Example: smc-mujoco basin inverted_pendulum --law classical --out classical.png
    """
    with loading():
        from rich.console import Console

        from smc_mujoco.analysis.region_of_attraction import CONVERGES, DOES_NOT, UNDECIDED
        from smc_mujoco.analysis.region_of_attraction import basin as search
        from smc_mujoco.common.files import ended, writable
        from smc_mujoco.common.progress import bar
        from smc_mujoco.draw import region

    clock, console = Clock(), Console()
    if out:
        region.checked(out)
        writable(out)
    if json:
        writable(ended(json, ".json"))
    chosen = options.law(law)
    with clock("in all"), bar(f"{law} on {plant}") as drawn:
        found = search(
            options.plant(plant),
            chosen,
            (points, points),
            gains=gains,
            duration=duration,
            threads=threads,
            report=drawn.reached,
            condition=condition,
        )
    counts = [int((found.outcome == kind).sum()) for kind in (CONVERGES, DOES_NOT, UNDECIDED)]
    share = f"{100 * found.share:.3g} % of the states converge"
    console.print(f"{found.law} on {found.plant}: {share}", highlight=False)
    said = "{} converge, {} do not, {} undecided".format(*counts)
    said += f" after {duration:g} s; {options.origin([chosen], gains)}, {clock.spent['in all']:.0f} s"
    console.print(said, style="dim", soft_wrap=True, highlight=False)
    written = [found.save(json)] if json else []
    written += [region.draw([found], out)] if out else []
    for path in written:
        wrote(console, path)
