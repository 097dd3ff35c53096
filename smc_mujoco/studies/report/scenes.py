"""The scenes of a report: runs of one plant beside each other, as curves, and as films where something renders."""

from collections.abc import Mapping, Sequence

from smc_mujoco.simulation.run import run
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.trace import Trace
from smc_mujoco.studies.paper import scenarios
from smc_mujoco.studies.report import films, words
from smc_mujoco.studies.report.bars import Report
from smc_mujoco.studies.report.findings import Scene
from smc_mujoco.studies.report.kept import kept
from smc_mujoco.studies.report.plan import GAINS
from smc_mujoco.studies.report.work import Work, part


def all_scenes(work: Work) -> tuple[Scene, ...]:
    """Runs beside each other: curves, and films where something renders."""
    plan, found = work.plan, []
    with work.bars.stage("scenes", f"{len(plan.scenes)} scenes") as report:
        for k, (plant, condition) in enumerate(plan.scenes):
            runs = scenarios.comparison(plant, condition, plan.scene_laws, duration=plan.scene, gains=GAINS)
            scene = _scene(work, runs, plant, condition, k < plan.filmed, part(report, k, len(plan.scenes)))
            found.append(scene)
            report(k + 1, len(plan.scenes))
    return tuple(found)


def _scene(
    work: Work,
    runs: Mapping[str, Scenario],
    plant: str,
    condition: str,
    filmed: bool,
    report: Report,
) -> Scene:
    traces = run(list(runs.values()), work.threads)
    first = traces[0].scenario
    film = poster = None
    if filmed and films.missing() is None:
        film, poster = _film(work, traces, plant, condition, report)
    return Scene(
        plant=plant,
        condition=condition,
        unit=first.plant.unit,
        u_max=first.u_max,
        curves=tuple(films.curve(trace) for trace in traces),
        film=film,
        poster=poster,
        seconds=work.plan.scene,
    )


def _film(work: Work, traces: Sequence[Trace], plant: str, condition: str, report: Report) -> tuple[bytes, bytes]:
    total, done = round(work.plan.scene * films.FPS), [0]

    def told(n: int) -> None:
        done[0] += n
        report(done[0], total)

    return kept(
        work.folder / f"film-{plant}-{condition}.webm",
        [work.plan.scene_laws, work.plan.scene, GAINS, films.SIZE, films.FPS, films.VP9],
        lambda: films.film(traces, f"{words.plant(plant)}, {words.condition(condition)}", told),
        films.save,
        films.load,
    )
