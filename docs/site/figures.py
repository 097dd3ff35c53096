"""Figures of the catalogue's pages, kept from one build to the next in .cache/site.

A figure is drawn again if anything changes that it may depend on: the rooms of the package up to
draw, the models, this file. SVGs are written into the pages, so that their ink is that of the page,
light or dark.
"""

import hashlib
import io
import os
import re
import warnings
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

ROOT = Path(__file__).parents[2]
CACHE = ROOT / ".cache" / "site"
PLANTS = ("inverted_pendulum", "van_der_pol", "duffing")
# condition -> colour, seen on white and on slate
CONDITIONS = {"nominal": "#2E86C1", "noise + sine": "#D35400"}
SLATE = "#1E2129"  # the dark page
FLIGHT_LAWS = "geometric", "quaternion_sliding", "cascaded_pid"
ARM_LAWS = (
    "computed_torque_sliding",
    "super_twisting_computed_torque",
    "passivity_based",
    "time_delay_sliding",
)
PAPER_LAWS = ("observer_free", "classical", "adaptive", "super_twisting")
# Rooms of the package that figures may depend on: those up to draw, as imports point down
ROOMS = ("common", "mechanisms", "control", "simulation", "metrics", "analysis", "draw")
DURATION = 4.0  # s, chosen: most laws settle in 2
PAGE_COLOURS = {  # colour of smc_mujoco.draw.style -> that of the page, lighter or not
    "INK": "",
    "DISTURBANCE": "",
    "MUTED": "--light",
    "RULE": "--lighter",
    "BAND": "--lightest",
    "GRID": "--lightest",
}
WIDTH, HEIGHT = 3.5, 3.5  # inches of a figure


def shown_on(template) -> tuple[str, ...]:
    """Return the plants of a law's figures."""
    return tuple(template.plants) or PLANTS


def law_figure(law: str, plant: str) -> bytes:
    """Return x and u of a law on a plant, in each of CONDITIONS, as SVG."""
    import smc_mujoco as smc

    traces = smc.run([_case(plant, law, condition) for condition in CONDITIONS])
    return _svg(traces, list(CONDITIONS.values()))


def plant_figure(plant: str) -> bytes:
    """Return x and u of the laws of `plant_laws` on a plant, as SVG."""
    import smc_mujoco as smc

    traces = smc.run([_case(plant, law, "nominal") for law in plant_laws(plant)])
    return _svg(traces, page_colours([trace.scenario.law for trace in traces]))


def page_colours(laws: Sequence) -> list[str]:
    """Return the colours of laws, those that are dark so light that they are seen on slate, too."""
    from smc_mujoco.draw import colouring, dark, style

    slate = {style.PAPER: SLATE, style.INK: style.PAPER}
    return [dark.on_dark(colour, slate) for colour in colouring.law_colours(laws)]


def still(plant: str) -> bytes:
    """Return a picture of a plant under the laws of `plant_laws`, as WebP; nothing without
    OpenGL.
    """
    import tempfile

    from PIL import Image

    import smc_mujoco as smc
    from smc_mujoco.common import gl

    if gl.missing_renderer():
        return b""
    traces = smc.run([_case(plant, law, "nominal") for law in plant_laws(plant)])
    with tempfile.TemporaryDirectory() as folder:
        picture = smc.film(traces, Path(folder) / "still.png", at=0.25)
        content = io.BytesIO()
        Image.open(picture).save(content, "WEBP", quality=85)
    return content.getvalue()


def plant_laws(plant: str) -> tuple[str, ...]:
    """Return the paper's laws if they can drive every joint of the plant, else the laws for it;
    without any, `none`.

    For an arm these are laws of many joints, for a free body laws of flight.
    """
    import smc_mujoco as smc

    law_names = smc.laws(plant)
    if smc.plant(plant).pose:
        return FLIGHT_LAWS
    if smc.plant(plant).rest:
        return ARM_LAWS
    if set(PAPER_LAWS) <= set(law_names):
        return PAPER_LAWS
    return tuple(name for name in law_names if name != "none") or ("none",)


def _case(plant: str, law: str, condition: str):
    """Return the scenario of a figure: tuned gains if there are any; a pendulum that swings up
    begins at rest.
    """
    import smc_mujoco as smc
    from smc_mujoco.common.errors import ScenarioError
    from smc_mujoco.simulation.grid import case

    if law == "swing_up":
        changes = {"x0": 3.1, "u_max": 1.2}
    else:
        changes = {}
    try:
        return case(plant, law, condition, DURATION, changes=changes)
    except ScenarioError:
        return case(plant, smc.law(law), condition, 2.0 * DURATION, changes=changes)


def _svg(traces: Sequence, colours: Sequence[str]) -> bytes:
    """Return the panels of x and u, one below the other; ink and grid have the colours of the page.

    Where bands of u would hide each other, each has a panel.
    """
    from matplotlib.figure import Figure

    from smc_mujoco.draw import lanes, panels, style
    from smc_mujoco.draw.decimate import end, finite

    traces = [finite(trace) for trace in traces]
    panel_rows = []
    for panel in (
        panel for quantity in ("x", "u") for panel in panels.over_groups(traces, quantity)
    ):
        rows = []
        for trace, colour in zip(panel.traces, colours, strict=True):
            rows.append((panel._replace(traces=[trace]), [colour]))
        if panel.quantity == "u" and lanes.crowded(panel):
            panel_rows += rows
        else:
            panel_rows += [(panel, colours)]
    with style.page():
        import matplotlib

        matplotlib.rcParams["svg.fonttype"] = "none"  # letters of the page
        figure = Figure(figsize=(WIDTH, HEIGHT * (0.5 + len(panel_rows) / 4)), layout="constrained")
        axes = figure.subplots(len(panel_rows), sharex=True, squeeze=False)[:, 0]
        for ax, (panel, shades) in zip(axes, panel_rows, strict=True):
            panels.over_time(ax, panel, shades)
            alone = len(panel.traces) == 1  # of several rows, which have no room for "control"
            words = panel.label.removeprefix("control ") if alone else panel.label
            ax.set(ylabel=words, xlim=(0.0, end(traces)))
            ax.locator_params(axis="y", nbins=5)
        axes[-1].set_xlabel("time (s)")
        figure.align_ylabels(axes)
        file = io.BytesIO()
        figure.savefig(
            file, format="svg", transparent=True, metadata={"Date": None, "Creator": None}
        )
    text = file.getvalue().decode()
    text = text[text.index("<svg") :]
    for old, new in PAGE_COLOURS.items():
        text = re.sub(
            rf"{getattr(style, old)}\b",
            f"var(--md-default-fg-color{new})",
            text,
            flags=re.IGNORECASE,
        )
    text = re.sub(rf"{style.PAPER}\b", "var(--md-default-bg-color)", text, flags=re.IGNORECASE)
    text = re.sub(r"font: ([\d.]+)px [^;\"]*", r"font-size: \1px", text)
    text = re.sub(r' d="[^"]+"', _rounded, text)
    text = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", text, flags=re.DOTALL)
    return re.sub(r"\s*\n\s*", " ", text).encode()


def _rounded(path: re.Match[str]) -> str:
    """Return a path of an SVG to a tenth of a pixel."""
    return re.sub(r"\d+\.\d{2,}", lambda number: f"{float(number[0]):.1f}", path[0])


def _version(also: Iterable[Path]) -> str:
    """Return a hash of all that figures depend on, and of further files."""
    files = [*(ROOT / "models").rglob("*.xml"), Path(__file__), *also]
    for room in ROOMS:
        files += (ROOT / "smc_mujoco" / room).rglob("*.py")
    files += (ROOT / "smc_mujoco" / "control" / "tuned_gains").rglob("*.json")
    seen = hashlib.sha256()
    for file in sorted(files):
        seen.update(file.read_bytes())
    return seen.hexdigest()[:16]


def _draw(name: str, draw: Callable[..., bytes], arguments: tuple[str, ...]) -> tuple[str, bytes]:
    with warnings.catch_warnings():
        # figures show what a condition does, whatever a law asks for
        warnings.simplefilter("ignore")
        return name, draw(*arguments)


def figures(
    wanted: Iterable[tuple[Callable[..., bytes], tuple[str, ...]]], also: Iterable[Path] = ()
) -> dict[tuple[str, ...], bytes]:
    """Return (function's name, its arguments ...) -> the figure; what is not in the cache is drawn
    on all cores.

    Args:
      wanted: functions and their arguments.
      also: further files that the figures depend on.
    """
    version = _version(also)
    content_by_key = {}
    jobs = []
    CACHE.mkdir(parents=True, exist_ok=True)
    for draw, arguments in wanted:
        key = draw.__name__, *arguments
        path = CACHE / f"{'-'.join(key)}-{version}"
        if path.is_file():
            content_by_key[key] = path.read_bytes()
        else:
            jobs.append((key, path, draw))
    if jobs:
        for drawn in {key[0] for key, _, _ in jobs}:
            for old in CACHE.glob(f"{drawn}-*"):
                if not old.name.endswith(version):
                    old.unlink()
        with ProcessPoolExecutor(os.cpu_count()) as pool:
            futures = [
                (key, path, pool.submit(_draw, path.name, draw, key[1:]))
                for key, path, draw in jobs
            ]
            for key, path, future in futures:
                content_by_key[key] = future.result()[1]
                part = path.with_suffix(f".{os.getpid()}")
                part.write_bytes(content_by_key[key])
                part.replace(path)
    return content_by_key
