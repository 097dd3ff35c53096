"""smc-mujoco compare, which: questions that many runs of many laws answer."""

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from smc_mujoco.analysis.relevant import RELEVANT
from smc_mujoco.cli.commands import options
from smc_mujoco.cli.console import Terminal, importing
from smc_mujoco.common.errors import ScenarioError
from smc_mujoco.common.text import counted

if TYPE_CHECKING:
    from smc_mujoco.simulation.trace import Trace
    from smc_mujoco.studies.recommendation import Recommendation
    from smc_mujoco.studies.table import Table

# pictures a second of the film; the largest is enough to follow a run, the smallest to see it
MAX_FPS, MIN_FPS = 15.0, 2.0
LEAST_LEFT = 0.05  # of the minutes, in which a first picture is begun; chosen
LEAST_MINUTES = 1e-3  # that are left when the command has loaded; chosen
MADE = 0.8  # of the time that is left, in which they must be made: then they are written; chosen

Seed = Annotated[int, typer.Option(min=0, help="Seed of initial states, noise and phases.")]


Needs = Annotated[
    str | None,
    typer.Option(
        "--need",
        help="What the law must keep, and what tables show, separated by commas. Limits, which "
        "searches keep: no-overshoot, overshoot<10 (in % of the way to the goal), calm (u rests "
        "where nothing moves). Properties, such as no-velocity; `smc-mujoco list --help` lists "
        "them under --need. Scores to show: fast (settling time), accurate (final error), "
        "on-track (ITAE), gentle (largest u), frugal (integral of u^2). Laws are compared by J, "
        "and those that settle reliably come first.",
    ),
]
WhichCondition = Annotated[
    list[str] | None, options.conditions_by_default("nominal, noise and sine")
]
WhichSeeds = Annotated[
    int | None, typer.Option(min=1, help="Runs of each law in each condition; default 14.")
]
WhichDuration = Annotated[float | None, typer.Option(help="Duration of a run, s; default 3.")]
WhichQuick = Annotated[
    bool, typer.Option("--quick", help="Answer within ten minutes, as --minutes 10 does.")
]
Falling = Annotated[
    bool,
    typer.Option(
        "--falling",
        help="Go on though the base of your model falls while its joints are held. Give a "
        "--duration that ends before it lies.",
    ),
]
Minutes = Annotated[
    float | None,
    typer.Option(
        help="Answer within so many minutes, with a film, or a still if there is no time for a "
        "film. Each law gets a first set of gains, from a shorter search where time is short. "
        "Default: until one law is shown to have the lowest J, or more searches would not tell."
    ),
]
Film = Annotated[bool, typer.Option(help="Whether to film the law's worst run.")]


def which(
    plant: options.PlantName,
    needs: Needs = None,
    condition: WhichCondition = None,
    law: options.Laws = None,
    quick: WhichQuick = False,
    seeds: WhichSeeds = None,
    duration: WhichDuration = None,
    x0: options.X0 = None,
    relevant: options.Relevant = RELEVANT,
    out: options.Folder = Path("which"),
    defaults: options.Defaults = False,
    seed: Seed = 0,
    json: options.Json = None,
    threads: options.Threads = None,
    device: options.Device = "cpu",
    executor: options.Executor = None,
    falling: Falling = False,
    minutes: Minutes = None,
    film: Film = True,
    full: options.Full = False,
) -> None:
    """Recommend a law for a plant: its gains, by how much it is better, and what it withstands.

    Laws race by J under the conditions asked for, and noise, with the package's gains or with gains
    that are searched now, until one is shown to have the lowest. u = 0 races, too. --law names the
    laws to try; without it, those that suit the plant are tried, the usual ones first, and on a
    model of your own only these. The folder has the report, the gains and a film of the worst run.
    A stopped command resumes when you start it again.

    Example: smc-mujoco which duffing --condition noise,coulomb --need calm,fast

    Example: smc-mujoco which arm.xml:shoulder --x0 0.5 --condition noise,friction --condition
    "worn: friction=Coulomb(0.05), sensor=Encoder(counts=4096)" --need "overshoot<10" --minutes 5
    """
    began = time.monotonic()
    with importing():
        from smc_mujoco.studies.which import QUICK_MINUTES
        from smc_mujoco.studies.which import which as recommend

    terminal = Terminal(json)
    length = QUICK_MINUTES if quick and minutes is None else minutes
    if film:
        from smc_mujoco.draw.film.film import missing_for_film

        if why := missing_for_film():
            terminal.note(f"{why}; with it, the same command makes the film, also later", wrap=True)
            film = False
    recommendation = recommend(
        plant,
        options.conditions(condition) or None,
        needs,
        options.parsed_laws(law) or None,
        seeds,
        duration,
        options.parsed_starts(x0),
        out,
        quick,
        threads,
        progress=True,
        defaults=defaults,
        relevant=relevant,
        seed=seed,
        device=device,
        executor=executor,
        falling=falling,
        minutes=length and max(LEAST_MINUTES, length - (time.monotonic() - began) / 60.0),
    )
    terminal.answer(recommendation, full)
    if film:
        ends = began + 60.0 * length if length else math.inf
        _film(recommendation, out, ends, terminal, LEAST_LEFT * 60.0 * (length or 0.0))
    _finish(recommendation.table, out, terminal)


def _worst_title(recommendation: "Recommendation") -> str:
    """Return the title of a figure or a film of the worst run of a race's first law."""
    from smc_mujoco.draw import wording

    run = recommendation.worst_trace.scenario
    return f"Worst run, {run.condition}: {wording.head([run])}"


def _film(
    recommendation: "Recommendation",
    out: Path,
    ends: float,
    terminal: Terminal,
    least: float = 0.0,
) -> None:
    """Film the worst run of the first law of a race until a time of `time.monotonic`, s, with as
    many pictures a second as can be made by then; if these are too few, write one picture. With
    less than `least` left, s, or where they take longer than the first ones told, write nothing.
    """
    from smc_mujoco.analysis.tuning.quick_search import OutOfTime
    from smc_mujoco.draw.film import film as films

    late = "no time for a film; the same command with more --minutes makes it"
    if ends - time.monotonic() <= least:
        terminal.note(late)
        return

    def on_time() -> None:
        if time.monotonic() > ends:
            raise OutOfTime

    run = [recommendation.worst_trace]
    title = _worst_title(recommendation)
    try:
        begun = time.monotonic()
        frames = films.Frames(run, title=title, size=films.FULL_SIZE)
        pictures = films.pictures(frames, between=on_time)
        next(pictures)
        first = time.monotonic()
        next(pictures, None)
        per_picture = time.monotonic() - first
        pictures.close()
        fit = (MADE * (ends - time.monotonic()) - (first - begun)) / per_picture  # pictures
        fps = min(MAX_FPS, films.FPS * fit / len(frames))
        if fps >= MIN_FPS:  # with fewer pictures a second, motion is shown more slowly
            frames = films.Frames(run, title=title, size=films.FULL_SIZE, fps=fps)
            fps = min(fps, fps * fit / len(frames))
        if fps >= MIN_FPS:
            frames = films.Frames(run, title=title, size=films.FULL_SIZE, fps=fps)
            ends += least  # what is nearly made is not thrown away
            terminal.wrote(films.write_film(frames, out / "worst.mp4", on_time))
        elif time.monotonic() + first - begun > ends:  # a picture takes as long again
            terminal.note(late)
        else:
            file = out / "worst.png"
            moment = _worst_time(recommendation.worst_trace)
            terminal.wrote(films.film(run, file, title=title, at=moment))
            needed = first - begun + MIN_FPS * per_picture * len(frames) / frames.fps
            terminal.note(
                f"This picture stands in place of a film, which would take {needed:.0f} s: the "
                "same command with more --minutes makes it.",
                wrap=True,
            )
    except OutOfTime:
        terminal.note(late)
    except ScenarioError as error:  # the answer stands without it
        terminal.note(f"no film: {error}", wrap=True)


def _worst_time(trace: "Trace") -> float:
    """Return when the error of a run is largest in its second half, in which single events are,
    s.
    """
    import numpy as np

    late = trace.t >= 0.5 * trace.t[-1]
    apart = np.nan_to_num(np.abs(trace.x - trace.r)).max(axis=1)
    return float(trace.t[late][np.argmax(apart[late])])


Condition = Annotated[
    list[str] | None,
    options.conditions_by_default(
        "twelve, one of each kind; with --quick nominal, noise and coulomb"
    ),
]
Seeds = Annotated[
    int, typer.Option(min=1, metavar="N", help="Runs of each law on each plant in each condition.")
]
Tune = Annotated[
    bool,
    typer.Option(
        help="Whether to tune a law if neither you nor the package gives its gains; default values "
        "in your file do not count."
    ),
]
Searches = Annotated[
    int | None,
    typer.Option(
        min=1,
        metavar="N",
        help="Searches that tune a law; default 12. With --rig, laws are tuned only with this.",
    ),
]
Worst = Annotated[
    bool,
    typer.Option(
        "--worst", help="Also search for the worst case of each law, as `smc-mujoco worst` does."
    ),
]
Duration = Annotated[
    float | None, typer.Option(help="Duration of a run, s; default 10, or 3 with --quick.")
]
Metrics = Annotated[
    str | None,
    typer.Option(
        "--metric",
        help="What to compare, separated by commas: any metrics of `smc-mujoco list metrics`, or "
        '"settles", the share of settled runs. Default: settles, settling_time, '
        "ultimate_bound, itae, tv_rate.",
    ),
]
Latex = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE.tex",
        help="Also write the tables as LaTeX: a tabular for each plant and condition. Put each "
        "into a float of its own. The comment above each says how to make it "
        "narrower: two metrics then fit a text column of 252 pt, or three if laws have short "
        "names. Five fit table*.",
    ),
]
Rig = Annotated[
    str | None,
    typer.Option(
        help="A real machine whose parameters were identified, from `smc-mujoco rig`: its "
        "parameter sets replace plants and conditions, and a line says for each metric whether one "
        "law wins on every set."
    ),
]


NOT_OF_RIGS = [
    "plants",
    "condition",
    "gains",
    "worst",
    "quick",
    "tune",
    "figure",
    "latex",
    "seed",
    "device",
    "executor",
]


def compare(
    ctx: typer.Context,
    plants: options.Plants = None,
    law: options.Laws = None,
    condition: Condition = None,
    seeds: Seeds = 12,
    tune: Tune = True,
    searches: Searches = None,
    worst: Worst = False,
    quick: options.Quick = False,
    gains: options.Gains = "tuned",
    duration: Duration = None,
    x0: options.X0 = None,
    metrics: Metrics = None,
    relevant: options.Relevant = RELEVANT,
    defaults: options.Defaults = False,
    out: options.Folder = Path("compared"),
    figure: Annotated[Path | None, options.picture("the medians")] = None,
    latex: Latex = None,
    rig: Rig = None,
    seed: Seed = 0,
    json: options.Json = None,
    threads: options.Threads = None,
    device: options.Device = "cpu",
    executor: options.Executor = None,
    full: options.Full = False,
) -> None:
    """Compare control laws on plants in conditions, and say which is best and how sure that is.

    Gains in brackets are used as they are. Otherwise a law has the gains that are shipped for the
    plant, or is tuned by one rule, the same for all laws, in seconds to minutes. Without --law the
    usual laws that suit the plant are compared, with --law all every general-purpose law.

    Example: smc-mujoco compare duffing,inverted_pendulum --law pid,my_law.py --condition
    friction,encoder

    Example: smc-mujoco compare arm.xml:shoulder --x0 0.5 --law pid,classical --condition noise
    --condition "mine: friction=my_parts.py:stribeck(static=0.3)" --figure arm --latex arm.tex
    """
    with importing():
        from smc_mujoco.common.files import with_ending
        from smc_mujoco.studies.compare import compare as run
        from smc_mujoco.studies.leaderboard import METRICS

        pictures = _pictures(figure)
    terminal = Terminal(json)
    shared = {
        "out": out,
        "metrics": options.parsed_names(metrics, METRICS),
        "duration": duration,
        "starts": options.parsed_starts(x0),
        "defaults": defaults,
        "searches": searches,
        "relevant": relevant,
        "threads": threads,
    }
    if rig is not None:
        without = "comparisons without --rig, which brings its own plant and gains: leave it out"
        options.only_for(ctx, NOT_OF_RIGS, False, without)
        _compare_on_rig(rig, law, seeds, shared, terminal, full)
        return
    latex = latex and with_ending(latex, ".tex")
    options.check_files(None, latex, *pictures)
    machines = options.plants(plants)
    comparison = run(
        options.compared_laws(law, machines, gains),
        machines or None,
        options.conditions(condition) or None,
        seeds,
        tune,
        worst,
        gains=gains,
        quick=quick,
        seed=seed,
        device=device,
        executor=executor,
        **shared,
    )
    terminal.answer(comparison, full)
    if latex:
        comparison.to_latex(latex)
        terminal.wrote(latex)
    if figure:
        comparison.plot(figure)
        terminal.wrote(*pictures)
    terminal.finish()


def _compare_on_rig(
    name: str,
    law: list[str] | None,
    seeds: int,
    shared: dict[str, Any],
    terminal: Terminal,
    full: bool,
) -> None:
    """Compare laws on the parameter sets of a rig. `shared`: what other comparisons take, too."""
    from smc_mujoco.identification import ensemble
    from smc_mujoco.identification.published_rig import rig

    machine = rig(name)
    chosen = options.parsed_laws(law, of_rig=machine.laws) or None
    table, boards, candidates = ensemble.compare_on_ensemble(machine, chosen, seeds, **shared)
    terminal.answer(boards, full)
    for candidate in candidates:
        terminal.note(f"{candidate.law} {candidate.remark}".strip(), wrap=True)
    terminal.note(ensemble.verdict(boards))
    _finish(table, shared["out"], terminal)


def _pictures(figure: Path | None) -> list[Path]:
    """Return the files of a figure; none without one."""
    if figure is None:
        return []
    from smc_mujoco.draw.page import files  # matplotlib takes 3 % of a short comparison

    return files(figure)


def _finish(table: "Table", out: Path, terminal: Terminal) -> None:
    """Print the number of runs and the file with all of them, and end the command."""
    failed = len(table) - table.data["failure"].null_count
    runs = f"{counted(len(table), 'run')}, {failed} stopped early"
    terminal.note(f"{runs}, {terminal.seconds:.0f} s")
    terminal.wrote(out / "results.parquet")
    terminal.finish()
