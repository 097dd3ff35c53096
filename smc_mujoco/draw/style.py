"""Style of figures and films: colours, labels, units and fonts.

Laws and plants state their labels and colours in their own files. The laws' colours are those of Okabe and Ito (Color
Universal Design, 2008), which colour-blind readers can tell apart. A law has the same colour everywhere.
"""

import colorsys
import functools
import itertools
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path

from smc_mujoco.common.errors import ScenarioError, shown, taken
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.law import catalogue
from smc_mujoco.mechanisms.plant import EFFORT
from smc_mujoco.metrics.channel_groups import Group, cut, groups
from smc_mujoco.simulation import reference
from smc_mujoco.simulation.trace import Trace

# Colours of laws that state none. Chosen from a grid as the farthest in CIEDE2000 from the stated ones, from each other
# and from whatever else is drawn: 18 and more with normal vision, 9 without red or green cones, 7.5 without blue ones.
# A just noticeable difference is about 1. The closest two stated ones are at 16 and 6.
OTHERS = ("#005A3C", "#960000", "#96B469", "#78784B", "#B42D69", "#7887FF")
INK, MUTED, GRID, PAPER, FAILED = "#1F2429", "#646C75", "#E3E6E9", "#FFFFFF", "#A9AFB6"
DISTURBANCE, BAND, RULE = "#3A3F46", "#DDE1E5", "#B9BFC5"
# Friction and contact. Chosen from a grid as one of the farthest in CIELAB from the laws' colours, the disturbance's
# and paper, with any colour blindness (G. M. Machado et al., IEEE TVCG 15(6), 2009).
REACTION = "#9018F0"

RC = {
    "font.family": "DejaVu Sans",
    "font.size": 10.5,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": "#9BA2A9",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.unicode_minus": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelsize": 9.5,
    "ytick.labelsize": 9.5,
    "legend.frameon": False,
    "lines.linewidth": 1.7,
    "lines.solid_capstyle": "round",
    "figure.facecolor": PAPER,
    "savefig.facecolor": PAPER,
    "svg.fonttype": "path",
    "svg.hashsalt": "smc_mujoco",  # the same traces give the same file
}


def page():
    """Return a context in which matplotlib draws in this style."""
    from matplotlib import rc_context

    return rc_context(RC)  # pyright: ignore[reportArgumentType]


def law_colour(law: Component | str) -> str:
    """Return the colour of a law, "#RRGGBB": its own, or always the same one of OTHERS."""
    template, name = _template(law)
    return (template and template.colour) or OTHERS[zlib.crc32(name.encode()) % len(OTHERS)]


def law_colours(laws: Sequence[Component | str]) -> list[str]:
    """Return one colour a law for one picture: its own, or another if an earlier law has that."""
    wanted = [law_colour(law) for law in laws]
    free = (colour for colour in _palette() if colour not in wanted)
    return [next(free) if colour in wanted[:i] else colour for i, colour in enumerate(wanted)]


def _palette() -> Iterator[str]:
    """Yield OTHERS, then the colours of the library's laws, then colours without end that differ in hue."""
    yield from OTHERS
    yield from dict.fromkeys(template.colour for template in catalogue().values() if template.colour)
    for k in itertools.count():
        hue, lightness = k * 0.618 % 1.0, (0.45, 0.3, 0.6)[k % 3]
        yield "#" + "".join(f"{round(255 * part):02X}" for part in colorsys.hls_to_rgb(hue, lightness, 0.6))


def law_name(law: Component | str) -> str:
    """Return a law's label: its own, or its name in words. A user's law keeps the user's name."""
    template, name = _template(law)
    return (template and template.label) or (in_words(name) if name in catalogue() else name)


def law_initials(law: str) -> str:
    """Return a law's name in two or three letters, for narrow places."""
    template, name = _template(law)
    return (template and template.short) or "".join(word[:1] for word in name.split("_")).upper()[:3] or "?"


def _template(law: Component | str) -> tuple[Template | None, str]:
    """Return the template of a law, if there is one, and the law's name."""
    if isinstance(law, str):
        return catalogue().get(law), law
    return law.template or catalogue().get(law.name), law.name


def in_words(name: str) -> str:
    """Return a name of the code as words: boundary_layer as "Boundary layer"."""
    return name[:1].upper() + name[1:].replace("_", " ")


def labels(traces: Sequence[Trace], given: Sequence[str] | None) -> list[str]:
    """Return one label a trace: the given ones, else the laws' labels, numbered if a law occurs more than once.

    Raises:
      ScenarioError: the number of labels is not that of the traces.
    """
    if given is not None:
        if isinstance(given, str) or len(given) != len(traces):
            raise ScenarioError(f"labels are {shown(given)} for {len(traces)} traces: give one string a trace")
        return [str(label) for label in given]
    names = [law_name(trace.scenario.law) for trace in traces]
    return [n if names.count(n) == 1 else f"{n} {names[:i].count(n) + 1}" for i, n in enumerate(names)]


def ending(trace: Trace) -> str:
    """Return how a run failed: "diverged at 0.4 s" (the plant) or "failed at 0.4 s" (its law); "" if it did not."""
    if trace.diverged_at is None:
        return ""
    off = trace.failure is None or trace.failure.startswith(reference.LEFT_THE_WORLD)
    return f"{'diverged' if off else 'failed'} at {trace.diverged_at:.3g} s"


def jumps(traces: Sequence[Trace], names: Sequence[str]) -> dict[float, str]:
    """Return the changes of plants, time in s -> "mass × 2"; begins with the runs' labels if only some change."""
    found: dict[tuple[float, str], list[str]] = {}
    for trace, name in zip(traces, names, strict=True):
        if jump := trace.scenario.jump:
            words = ", ".join(f"{what} × {factor:.3g}" for what, factor in jump.factors.items())
            found.setdefault((jump.time, words), []).append(name)
    changes: dict[float, list[str]] = {}
    for (time, words), who in sorted(found.items()):
        changes.setdefault(time, []).append(words if len(who) == len(traces) else f"{', '.join(who)}: {words}")
    return {time: "; ".join(parts) for time, parts in changes.items()}


@functools.cache
def font(size: float, bold: bool = False):
    """Return DejaVu Sans, which matplotlib ships, as a font of Pillow; letters `size` high."""
    import matplotlib
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(matplotlib.get_data_path(), "fonts", "ttf", name)), size)


def width(text: str, size: float, bold: bool = False) -> float:
    """Return the width of a text, in the unit of `size`, the height of its letters."""
    return font(10 * size, bold).getlength(text) / 10  # Pillow rounds small letters to pixels


def cropped(text: str, room: float, size: float, bold: bool = False) -> str:
    """Return the text on one line, with an ellipsis at its end if it is wider than the room."""
    text = cut = " ".join(text.split())
    while cut and width(cut if cut == text else f"{cut}…", size, bold) > room:
        cut = cut[:-1]
    return text if cut == text else f"{cut.rstrip()}…"


def same_plant(traces: Trace | Sequence[Trace]) -> list[Trace]:
    """Return the traces as a list.

    Raises:
      ScenarioError: no traces, or traces that cannot share axes.
    """
    traces = [traces] if isinstance(traces, Trace) else taken("traces", traces)
    if not traces:
        raise ScenarioError("no traces to draw: give at least one, from smc.run(...) or smc.load(...)")
    plants = sorted({trace.scenario.plant.name for trace in traces})
    if len(plants) > 1:
        raise ScenarioError(f"traces of {' and '.join(plants)} share no axes: draw one plant at a time")
    if len({tuple((g.name, g.unit) for g in groups(trace.scenario.plant)) for trace in traces}) > 1:
        raise ScenarioError(
            f"traces of {plants[0]} differ in their kinds of channels: draw those with the same ones at a time"
        )
    return traces


def split(traces: Sequence[Trace]) -> dict[Group, list[Trace]]:
    """Return the traces of each group of channels, which share a pair of axes. All traces are of one plant."""
    kinds = zip(*(groups(trace.scenario.plant) for trace in traces), strict=True)
    return {kind[0]: [cut(trace, group) for trace, group in zip(traces, kind, strict=True)] for kind in kinds}


def units(group: Group) -> dict[str, str]:
    """Return the units of x, v, u and s of a group's channels."""
    x = group.unit
    return {"x": x, "v": f"{x}/s", "u": EFFORT[x].replace(" ", "·"), "s": f"{x}/s"}


def plant_name(trace: Trace) -> str:
    """Return the plant's label: its own, or its name in words. A user's model keeps the user's name."""
    plant = trace.scenario.plant
    return plant.label or (plant.name if plant.direct else in_words(plant.name))


def rgb(colour: str) -> tuple[int, int, int]:
    """Return #RRGGBB as three numbers, 0 .. 255."""
    return tuple(bytes.fromhex(colour[1:]))  # pyright: ignore[reportReturnType]


def letters_on(colour: str) -> str:
    """Return the colour of letters that are easier to read on a colour, white or ink (luma of ITU-R BT.601)."""
    red, green, blue = rgb(colour)
    return INK if 0.299 * red + 0.587 * green + 0.114 * blue > 140 else PAPER


def short(value: float, digits: int = 2) -> str:
    """Return a number in few digits, as 0.25, 6, 280; with an exponent only from 1e6 on."""
    return f"{float(f'{value:.{digits}g}'):g}"
