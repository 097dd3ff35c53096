"""smc-mujoco accuracy: how the errors of laws fall with the control period."""

from pathlib import Path
from typing import Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.terminal import Terminal
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.interrupts import delay_ctrl_c


def accuracy(
    plants: Annotated[
        list[str],
        typer.Argument(
            metavar="PLANT",
            autocompletion=options.PLANTS,
            help="Plants from `smc-mujoco list`, or FILE.xml:joint+joint.",
        ),
    ],
    law: options.Laws = None,
    condition: options.Condition = "constant",
    periods: Annotated[
        str, typer.Option(help="Control periods, s, as a,b.")
    ] = "0.004,0.002,0.001,0.0005,0.00025",
    seeds: Annotated[
        int, typer.Option(min=1, help="Initial states of each law at each period.")
    ] = 3,
    gains: options.Gains = "tuned",
    duration: Annotated[float, typer.Option(help="Duration of the runs, s.")] = 10.0,
    x0: options.X0 = None,
    out: Annotated[Path | None, options.picture("error over period")] = None,
    json: options.Json = None,
    threads: options.Threads = None,
) -> None:
    """Find how accurate laws are without noise: how their errors fall as they are computed more
    often.

    Under a disturbance, a law that is sampled with the control period h keeps |e| and |s| below a
    multiple of h to some power, the order of accuracy. Theory promises the order 0 for a smooth law
    or one with a boundary layer (a shorter period does not help), 1 for a relay (half the period,
    half the error), 2 for second-order sliding modes such as twisting and super-twisting (a
    quarter), and r for order r. The command runs every law at several periods and prints the order
    that it measures beside the one that is promised. A line with * says what was left out, and why
    an order is not as promised: the runs may still be settling, the gains may be too small for the
    disturbance, or the error may be mere rounding. The law of your file has its default gains: tune
    it first (`smc-mujoco tune`).

    The default disturbance is a constant force of 0.2 N or N m. --condition coulomb asks the same
    of dry friction, and
    --condition "constant + sine" of a force that changes, against which laws need gains for its
    rate.

    Example: smc-mujoco accuracy duffing --condition coulomb --law
    classical,twisting,super_twisting,observer_free
    """
    with delay_ctrl_c():
        from smc_mujoco.common.progress import bar
        from smc_mujoco.control import gain_sets
        from smc_mujoco.draw.page import files
        from smc_mujoco.evidence.accuracy.accuracy import accuracy as measure
        from smc_mujoco.mechanisms.named import as_plant

    terminal = Terminal()
    pictures = files(out)
    options.check_files(json, *pictures)
    machines = [as_plant(text) for text in options.names(plants)]
    chosen = options.laws(law, gain_sets.LAWS)
    h = _periods(periods)
    start = options.starts(x0)
    with bar("accuracy") as progress:
        table = measure(
            chosen, machines, h, condition, seeds, gains, duration, start, threads, progress.reached
        )
    terminal.print(table)
    terminal.note(f"{sum(row.runs for row in table)} runs, {terminal.seconds:.0f} s", "dim")
    if json:
        terminal.wrote(table.save(json))
    if pictures:
        table.plot(out)
        terminal.wrote(*pictures)


def _periods(text: str) -> list[float]:
    """Return the control periods in the option --periods, s; raise ScenarioError if they cannot be
    read.
    """
    try:
        return [float(period) for period in options.names(text)]
    except ValueError:
        raise ScenarioError(
            f"--periods {text!r} cannot be read: give numbers in s, as 0.004,0.002,0.001"
        ) from None
