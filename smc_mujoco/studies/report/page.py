"""The HTML page of a report, which needs no network and no other file.

    page(findings)                 # the HTML, a str

Text is escaped by jinja2; charts are JSON in the page, drawn by plotly.js, which is embedded once; films and pictures
are data URIs. A content security policy in the file forbids everything that is not in it.
"""

import base64
import functools
import math
import re
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from smc_mujoco.mechanisms.plant import catalogue
from smc_mujoco.metrics.catalogue import metrics as catalogue_of_metrics
from smc_mujoco.studies.report import answer, charts, definitions, maps, words
from smc_mujoco.studies.report.findings import Findings, Gains, Score

TEMPLATES = Path(__file__).parent / "templates"
SECTIONS = {
    "overview": "The answer",
    "claims": "The paper’s claims",
    "tradeoffs": "Error against effort",
    "margins": "Margins",
    "regions": "Regions of attraction",
    "films": "Films and traces",
    "method": "How it was computed",
}


def page(findings: Findings) -> str:
    """Return the report as HTML."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from jinja2.utils import htmlsafe_json_dumps
    from markupsafe import Markup
    from plotly.offline import get_plotlyjs

    loader = FileSystemLoader(TEMPLATES)
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {"json": htmlsafe_json_dumps, "margin_kind": words.kind}
    environment.globals |= {"words": words, "f": findings, "about": findings.about, "infinity": math.inf}
    fixed = {
        "css": Markup((TEMPLATES / "style.css").read_text()),
        "js": Markup((TEMPLATES / "page.js").read_text()),
        "plotly": Markup(get_plotlyjs().replace("</script", "<\\/script")),
        "sections": [SimpleNamespace(id=id, title=title) for id, title in SECTIONS.items()],
    }
    parts = overview(findings) | claims(findings) | tradeoffs(findings) | margins(findings) | regions(findings)
    return environment.get_template("page.jinja").render(fixed | parts | films(findings) | method(findings))


def overview(findings: Findings) -> dict[str, Any]:
    """Return what the first section shows."""
    found = answer.cells(findings.scores)
    headline = [m for m in words.HEADLINE if any(s.metric == m for s in findings.scores)]
    first = "nominal" if "nominal" in findings.conditions else findings.conditions[0]
    here = [s for s in findings.scores if s.condition == first]
    return {
        "answer": answer.paragraph(findings, headline),
        "headline": headline,
        "columns": [m for m in words.COLUMNS if any(s.metric == m for s in findings.scores)],
        "first": first,
        "overall": {metric: answer.overall(findings, metric) for metric in headline},
        "by_plant": by_plant(findings),
        "forest": charts.forest(here, headline, findings.plants, findings.laws),
        "leaders": functools.partial(answer.leaders, found),
        "undecided": answer.undecided(found, headline),
        "losses": answer.losses(found, headline),
        "board": board(findings.scores),
    }


def by_plant(findings: Findings) -> list[SimpleNamespace]:
    """Return the rows of the ranking by plant, each with a Place in every metric, or None."""
    known = {(p.plant, p.law, p.metric): p for p in findings.places}
    return [
        SimpleNamespace(plant=plant, law=law, places={m: known.get((plant, law, m)) for m in words.RANKED})
        for plant in findings.plants
        for law in findings.laws
        if any((plant, law, m) in known for m in words.RANKED)
    ]


def board(scores: Sequence[Score]) -> list[SimpleNamespace]:
    """Return the leaderboard's rows: a plant, condition and law, with a score in every column, or None."""
    rows: dict[tuple[str, str, str], dict[str, Score]] = {}
    for score in scores:
        rows.setdefault((score.plant, score.condition, score.law), {})[score.metric] = score
    return [
        SimpleNamespace(plant=p, condition=c, law=law, scores={m: its.get(m) for m in words.COLUMNS})
        for (p, c, law), its in rows.items()
    ]


def claims(findings: Findings) -> dict[str, Any]:
    """Return what the section on claims shows."""
    sets = list(dict.fromkeys(name for claim in findings.claims for name in claim.verdicts))
    rises = ", ".join(f"{words.plant(f.plant)} {100 * f.share:.0f} percent" for f in findings.fields)
    return {
        "sets": sets,
        "counts": {name: n for name, n in answer.counts(findings).items() if n},
        "checks": functools.partial(checks, sets),
        "decided": functools.partial(decided, findings.about.gains_set),
        "beside": functools.partial(beside, sets),
        "fields": maps.fields(findings.fields) if findings.fields else None,
        "rising": rises,
    }


def checks(sets: Sequence[str], claim: Any) -> list[SimpleNamespace]:
    """Return a row for each check of a claim, with a column for each set of gains; checks that fail come first."""
    names = dict.fromkeys(what for name in sets for what in claim.numbers.get(name, {}))
    rows = []
    for what in names:
        found = [claim.numbers.get(name, {}).get(what) for name in sets]
        its = [SimpleNamespace(**check) if check else None for check in found]
        limits = {(check.relation, check.limit) for check in its if check}
        must = " ".join([f"{words.pretty(r)} {words.number(v)}" for r, v in limits]) if len(limits) == 1 else ""
        rows.append(SimpleNamespace(what=what, must=must, checks=its, link=link(what)))
    return sorted(rows, key=lambda row: all(check is None or check.holds for check in row.checks))


def decided(gains: str, claim: Any) -> SimpleNamespace | None:
    """Return the check that decides a claim under these gains, or under the first that it was judged with."""
    name = gains if gains in claim.numbers else next(iter(claim.numbers), "")
    one = claim.decisive(name) if name else None
    if one is None:
        return None
    limit = f"{words.pretty(one.relation)} {words.number(one.limit)}"
    return SimpleNamespace(gains=name, what=one.what, value=one.value, limit=limit, holds=one.holds)


def beside(sets: Sequence[str], claim: Any) -> list[SimpleNamespace]:
    """Return a row for each number beside a claim's checks, with a value for each set of gains, or None."""
    found = [claim.beside.get(name, {}) for name in sets]
    names = dict.fromkeys(what for its in found for what in its)
    return [SimpleNamespace(what=n, values=[its.get(n) for its in found], link=link(n)) for n in names]


def link(what: str) -> str:
    """Return the anchor of the metric that a check names, else that of "verdict"."""
    names = {called: m.name for m in catalogue_of_metrics() for called in (m.name, words.metric(m.name))}
    known = "|".join(re.escape(name) for name in sorted(names, key=len, reverse=True))
    found = re.search(rf"(?<!\w)({known})(?!\w)", what)
    return f"metric-{names[found[1]]}" if found else "verdict"


def tradeoffs(findings: Findings) -> dict[str, Any]:
    """Return what the section on error against effort shows."""
    there = [plant for plant in findings.plants if any(f.plant == plant for f in findings.fronts)]
    return {"fronts": charts.fronts(findings.fronts, there) if there else None, "fronts_of": "5 s"}


def margins(findings: Findings) -> dict[str, Any]:
    """Return what the section on margins shows."""
    kinds = dict.fromkeys(margin.kind for margin in findings.margins)
    plants = [p for p in findings.plants if any(m.plant == p for m in findings.margins)]
    laws = [law for law in findings.laws if any(m.law == law for m in findings.margins)]
    shown = []
    for kind in kinds:
        units = dict.fromkeys(words.typeset(m.unit) for m in findings.margins if m.kind == kind)
        figure = charts.margins(findings.margins, kind, plants, laws)
        shown.append(
            SimpleNamespace(name=kind, figure=figure, unit=" or ".join(u for u in units if u not in ("", "1")))
        )
    order = list(kinds)
    rows = sorted(findings.margins, key=lambda m: order.index(m.kind))
    return {"kinds": shown, "margin_rows": rows, "set_margins": set_margins(findings)}


def set_margins(findings: Findings) -> list[SimpleNamespace]:
    """Return a row for each kind of margin, plant and law, with a Margin under each set of gains, or None."""
    known = {(m.kind, m.plant, m.law, name): m for name, own in findings.by_set.items() for m in own}
    rows = dict.fromkeys(key[:3] for key in known)
    return [
        SimpleNamespace(
            kind=kind, plant=plant, law=law, by_set=[known.get((kind, plant, law, n)) for n in findings.by_set]
        )
        for kind, plant, law in rows
    ]


def regions(findings: Findings) -> dict[str, Any]:
    """Return what the section on regions of attraction shows."""
    shown, after = [], maps.horizons(findings.basins)
    for plant in dict.fromkeys(basin.plant for basin in findings.basins):
        own = [basin for basin in findings.basins if basin.plant == plant]
        shares = [f"{words.law(b.law)} {100 * b.share:.0f} percent" for b in own]
        points = " × ".join(str(n) for n in own[0].outcome.shape[::-1])
        shown.append(
            SimpleNamespace(plant=plant, figure=maps.basins(own, after), told=", ".join(shares), points=points)
        )
    return {"maps": shown, "meanings": maps.meanings(findings.basins)}


def films(findings: Findings) -> dict[str, Any]:
    """Return what the section on films and traces shows."""
    shown = []
    for scene in findings.scenes:
        network = scene.plant in catalogue() and catalogue()[scene.plant].network
        shown.append(
            SimpleNamespace(
                scene=scene,
                film=uri("video/webm", scene.film),
                poster=uri("image/jpeg", scene.poster),
                figure=charts.curves(scene),
                laws=", ".join(words.law(curve.law) for curve in scene.curves),
                network=network,
            )
        )
    return {"scenes": shown}


def uri(kind: str, data: bytes | None) -> str:
    """Return bytes as a data URI, "" for none."""
    return f"data:{kind};base64,{base64.b64encode(data).decode()}" if data else ""


def method(findings: Findings) -> dict[str, Any]:
    """Return what the last section shows."""
    return {
        "terms": definitions.terms(list(dict.fromkeys(margin.kind for margin in findings.margins))),
        "metrics": definitions.metric_terms(),
        "gain_sets": list(dict.fromkeys(row.set for row in findings.about.gains)),
        "gain_laws": list(dict.fromkeys(row.law for row in findings.about.gains)),
        "gain_rows": gain_rows(findings.about.gains),
    }


def gain_rows(found: Sequence[Gains]) -> list[SimpleNamespace]:
    """Return a row for each law on each plant, with the Gains of each set, none or several."""
    sets = list(dict.fromkeys(row.set for row in found))
    rows: dict[tuple[str, str], dict[str, list[Gains]]] = {}
    for row in found:
        rows.setdefault((row.plant, row.law), {name: [] for name in sets})[row.set].append(row)
    return [SimpleNamespace(plant=plant, law=law, by_set=by_set) for (plant, law), by_set in rows.items()]
