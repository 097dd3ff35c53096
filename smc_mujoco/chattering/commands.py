"""smc-mujoco chatter: the limit cycles of laws, predicted and measured."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from smc_mujoco.cli.commands import options
from smc_mujoco.cli.console import Terminal, importing

if TYPE_CHECKING:
    from smc_mujoco.chattering.prediction import Chattering
    from smc_mujoco.common.progress import Report
    from smc_mujoco.simulation.scenario import Scenario

Actuator = Annotated[
    str | None,
    typer.Option(
        metavar="PART:NUMBERS",
        help="What drives the joints, as lag:0.01, ratelimit:200 or dcmotor.",
    ),
]
Duration = Annotated[float, typer.Option(min=0.1, help="Duration of the runs that measure it, s.")]


def chatter(
    plant: options.PlantName,
    law: options.Laws = None,
    actuator: Actuator = None,
    condition: options.Condition = "nominal",
    gains: options.Gains = "tuned",
    channel: Annotated[int, typer.Option(min=0, help="The driven channel.")] = 0,
    duration: Duration = 8.0,
    figure: Annotated[Path | None, options.picture("Nyquist plots and runs")] = None,
    json: options.Json = None,
    threads: options.Threads = None,
) -> None:
    """Predict the chattering of laws by harmonic balance, and measure it in simulations.

    If a law switches and the actuator lags, the loop oscillates without end. Amplitude and
    frequency are those at which N L = 1: N is the law's describing function, L the response of the
    linearised mechanism. The column "±" is how far the prediction may be off, and "irregular" where
    that is more than 100 %, as the cycle may lock to the control's samples. A star marks a run
    that changes by more than 5 % if its start changes by a relative 1e-9, or at half the physics
    step (2.5 % without RK4). The column "third harmonic" is that over the first. With several
    driven channels, "coupling" is how far this channel's command moves another channel, over how
    far it moves its own. If that is large, the prediction fails.

    Example: smc-mujoco chatter duffing --law classical,super_twisting --actuator lag:0.01 --figure
    chatter
    """
    with importing():
        from smc_mujoco.analysis.step_halving import step_halving
        from smc_mujoco.chattering.cycle_tables import cycle_rows, table
        from smc_mujoco.common.progress import bar
        from smc_mujoco.control import gain_sets
        from smc_mujoco.control.source import in_words
        from smc_mujoco.draw.page import files
        from smc_mujoco.mechanisms.named import jointed
        from smc_mujoco.metrics.limit_cycle import channel_cycle
        from smc_mujoco.simulation.grid import case
        from smc_mujoco.simulation.run import run

    terminal = Terminal(json)
    pictures = files(figure)
    chosen = options.parsed_laws(law, gain_sets.LAWS)
    options.check_files(None, *pictures)
    fields = {} if actuator is None else {"actuator": options.actuator(actuator)}
    machine = jointed(plant, "chattering")
    cases = []
    for name in chosen:
        cases.append(case(machine, name, condition, duration, gains, changes=fields))
    sources = in_words({scenario.law.name: [scenario.law.source] for scenario in cases})
    with bar("chattering") as progress:
        cycles = _cycles(cases, channel, progress.reached)
        traces = run(cases, threads=threads)
        measured = [channel_cycle(trace, channel) for trace in traces]
        changes = step_halving(traces, channel, threads)
    terminal.print(table(cases, channel, cycles, measured, changes))
    terminal.note(f"assumed: {_assumed(cycles)}", wrap=True)
    terminal.note(f"{sources}, {terminal.seconds:.0f} s", "dim", wrap=True)
    terminal.finish(cycle_rows(cases, cycles, measured, changes))
    if pictures:
        from smc_mujoco.chattering.nyquist import nyquist

        nyquist(cases, channel, cycles, traces, changes, figure)
        terminal.wrote(*pictures)


def _assumed(cycles: "Sequence[Chattering]") -> str:
    """Return each assumption of some predictions once."""
    assumed = {}
    for cycle in cycles:
        assumed |= dict.fromkeys(cycle.assumptions)
    return "; ".join(assumed)


def _cycles(cases: "Sequence[Scenario]", channel: int, report: "Report") -> "list[Chattering]":
    """Return the limit cycles that harmonic balance predicts, a case after the other."""
    from smc_mujoco.chattering.prediction import chattering

    cycles = []
    for done, scenario in enumerate(cases):
        report(done, len(cases) + 1)
        cycles.append(chattering(scenario, channel))
    return cycles


GROUPS = {"Tune and analyse": [chatter]}  # heading in the help -> commands
