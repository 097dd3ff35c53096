"""What pages show that the package knows, written into them when the site is built, in place of
links and markers.
"""

import inspect
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import catalogue

import smc_mujoco as smc
from smc_mujoco.control.law import joint_law_catalogue as joint_laws
from smc_mujoco.draw import wording
from smc_mujoco.evidence.audit.paper import paper
from smc_mujoco.evidence.audit.verdict import DERIVED, MARKS, OURS, PAPER, VERDICTS, WHOSE_WORDS
from smc_mujoco.mechanisms.plant import plant_catalogue as plants
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.studies import scene

# see test_full_verdicts.py
AUDITS = json.loads((Path(__file__).parent / "verdicts.json").read_text(encoding="utf-8"))
# of the package's docstring
TASKS = re.compile(r"^    ([A-Z][a-z ,]+): ((?:.|\n {8})+)$", re.MULTILINE)

SHELVES = {  # module of public names -> title of its page
    "signals": "References and disturbances",
    "hardware": "Real mechanisms",
    "design": "Gains from theory, chattering, regions of attraction",
    "accuracy": "Accuracy",
    "metrics": "Scores of joints and tips",
    "exchange": "Laws from and to C and FMUs",
    "envs": "Environments for agents",
    "errors": "Warnings",
}
OTHERS = {  # title -> names of modules that are no public names
    "Types that are returned": """
    studies.compare.Compared
    studies.scene.Outcome
    draw.film.film.Frames
    identification.rig.Rig
    identification.published_rig.PublishedRig
    envs.flight_env.FlightEnv
    studies.which.Recommendation
    analysis.tuning.result.Tuned
    identification.identify.Identified
    evidence.accuracy.orders.AccuracyTable
    chattering.prediction.Chattering
    analysis.step_halving.StepChange
    robustness.worst_case.WorstCase
    evidence.audit.audit.Audit
    evidence.audit.verdict.Claim
    """,
    "The paper, tests": """
    simulation.gaber_study
    testing.plugin.step_response
    testing.plugin.smc_golden
    testing.response.StepResponse
    """,
}


def tasks() -> dict[str, list[str]]:
    """Return task -> the public names that `help(smc)` lists for it."""
    return {task: re.findall(r"\w+", names) for task, names in TASKS.findall(smc.__doc__ or "")}


def entries() -> dict[str, list[str]]:
    """Return title -> the names on a page of the reference, with their modules."""
    origins = smc._LAZY.origins  # pyright: ignore[reportAttributeAccessIssue] private
    names_by_task = {}
    for task, task_names in tasks().items():
        names_by_task[task] = [f"{origins[name]}.{name}" for name in task_names if name in origins]
    shelves = {}
    for shelf, title in SHELVES.items():
        shelves[title] = [
            _path(getattr(getattr(smc, shelf), name)) for name in getattr(smc, shelf).__all__
        ]
    return (
        names_by_task
        | shelves
        | {
            title: [f"smc_mujoco.{name}" for name in task_names.split()]
            for title, task_names in OTHERS.items()
        }
    )


def _path(thing: Any) -> str:
    """Return the full name of a function, class or module."""
    if inspect.ismodule(thing):
        return thing.__name__
    return f"{thing.__module__}.{thing.__qualname__}"


def reference() -> dict[str, str]:
    """Return path -> a page of the reference, as mkdocstrings reads it."""
    titled = {
        title: "\n".join(f"::: {name}" for name in members) for title, members in entries().items()
    }
    return {path(title): f"# {title}\n\n{names}\n" for title, names in titled.items()}


def path(title: str) -> str:
    """Return the file of a page of the reference."""
    return f"api/{re.sub(r'[^a-z]+', '_', title.lower())}.md"


def contents() -> Iterator[str]:
    """Yield the pages of the reference, with a link to each name."""
    for title, names in entries().items():
        links = (f"[`{name.rpartition('.')[2]}`]({path(title)}#{name})" for name in names)
        yield f"- [{title}]({path(title)}): {', '.join(links)}"


def machines() -> Iterator[str]:
    """Yield a table of the plants, with the words at the top of their files."""
    yield "| plant | what it is |\n|---|---|"
    for name, plant in plants().items():
        title, _, about = catalogue.equation(catalogue.described(plant))
        words = " ".join(about.split("\n\n")[0].split()).rstrip(" .")
        yield _row(f"`{name}`", _plain(", ".join(filter(None, (title, words)))))


def kinds() -> Iterator[str]:
    """Yield a table of the laws by family."""
    yield "| family | laws |\n|---|---|"
    for family, names in (catalogue.families() | {"many joints": list(joint_laws())}).items():
        yield _row(wording.in_words(family), ", ".join(f"`{name}`" for name in names))


def definitions() -> Iterator[str]:
    """Yield a table of the metrics, as their docstrings define them."""
    yield "| metric | unit | definition |\n|---|---|---|"
    for metric in metrics():
        unit = re.sub(r"[(){}]", "", metric.unit).replace("^2", "²")
        yield _row(f"`{metric.name}`", unit, _plain(inspect.getdoc(metric.formula) or ""))


def instead() -> Iterator[str]:
    """Yield a table of what holds instead of each claim of Gaber's paper that does not hold
    everywhere.
    """
    yield "| claim | instead | shown by |\n|---|---|---|"
    for claim in paper("gaber").claims.values():
        if claim.instead:
            yield _row(
                f"{claim.id}: {_plain(claim.text)}", _plain(claim.instead), f"`{claim.shown_by}`"
            )


def audits() -> Iterator[str]:
    """Yield a table of the audits: what was read, and how many sentences of the paper have each
    verdict.
    """
    kinds = VERDICTS[:-1]
    heads = "audit", "read", *(MARKS[kind] for kind in kinds), "derived", "questions"
    yield f"{_row(*heads)}\n|{'---|' * len(heads)}"
    for name, verdict_by_claim in AUDITS.items():
        about = paper(name)
        whose = {id: claim.whose for id, claim in about.claims.items()}
        own = [verdict for id, (verdict, *_) in verdict_by_claim.items() if whose[id] == PAPER]
        counts = [
            *map(own.count, kinds),
            *(list(whose.values()).count(kind) for kind in (DERIVED, OURS)),
        ]
        yield _row(f"`{name}`", about.read, *(str(count) if count else "" for count in counts))


def decisions() -> Iterator[str]:
    """Yield each audit's claims with their verdicts and the checks that decide, in a box that
    opens.
    """
    for name, verdict_by_claim in AUDITS.items():
        about = paper(name)
        yield f'\n??? note "{about.authors}: {about.title}"\n'
        yield f"    `{name}`: {_plain(about.source)}. Read: {about.read}; {_plain(about.access)}.\n"
        yield "    | claim | verdict | decided by |\n    |---|---|---|"
        for id, (verdict, decided, _) in verdict_by_claim.items():
            claim = about.claims[id]
            whose = f", {WHOSE_WORDS[claim.whose]}" * (claim.whose != PAPER)
            immune = f". No broken law can lose it: {claim.immune}" * bool(claim.immune)
            cells = f"{id}{whose}: {claim.text}{immune}", f"{MARKS[verdict]} {verdict}", decided
            yield f"    {_row(*map(_plain, cells))}"


def questions() -> Iterator[str]:
    """Yield a table of the scenes."""
    yield "| scene | question |\n|---|---|"
    for name, path in scene.scenes().items():
        yield _row(f"`{name}`", _plain(scene.question(path)))


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _plain(text: str) -> str:
    """Return text in one line, in which no letter means anything to Markdown."""
    return re.sub(r"([|_*<\[\]`\\])", lambda found: f"&#{ord(found[1])};", " ".join(text.split()))


SHOWN = {  # what the repository's page shows -> lines of the site's
    "<!-- every public name -->": contents,
    "[Every plant](../smc_mujoco/mechanisms/plants)": machines,
    "[Every law](../smc_mujoco/control/laws)": kinds,
    "[Every metric](../smc_mujoco/metrics/catalogue.py)": definitions,
    "<!-- what holds instead of each claim -->": instead,
    "[Every scene](../scenes)": questions,
    "[Every audit](../benchmarks/papers)": audits,
    "<!-- what decides every claim -->": decisions,
}


def filled(markdown: str) -> str:
    """Return a page with what its markers stand for."""
    for marker, lines in SHOWN.items():
        if marker in markdown:
            markdown = markdown.replace(marker, "\n".join(lines()))
    return markdown
