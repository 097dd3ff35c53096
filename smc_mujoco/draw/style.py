"""How laws, units and pages look, in figures and films alike.

Colours are those of Okabe and Ito (Color Universal Design, 2008), told apart by colour-blind readers; a law keeps its
colour everywhere. The fonts ship with matplotlib.
"""

import functools
import zlib
from collections.abc import Sequence
from pathlib import Path

from smc_mujoco.common.errors import ScenarioError, shown, taken
from smc_mujoco.mechanisms.plant import EFFORT
from smc_mujoco.metrics.channel_groups import Group, cut, groups
from smc_mujoco.simulation import reference
from smc_mujoco.simulation.trace import Trace

COLOURS = {
    "observer_free": "#0072B2",
    "adaptive": "#D55E00",
    "classical": "#E69F00",
    "super_twisting": "#009E73",
    "conditioned_super_twisting": "#6A4C93",
    "boundary_layer": "#CC79A7",
    "adaptive_leak": "#56B4E9",
    "none": "#6E7781",
}
# Of a grid of colours those farthest in CIEDE2000 from the ones above, from each other and from what else is drawn,
# as seen by most eyes (18 and more) and with any colour blindness (7.5; red or green 9). A just noticeable difference
# is about 1, and the closest two above are at 16 and 6.
OTHERS = ("#005A3C", "#960000", "#96B469", "#78784B", "#B42D69", "#7887FF")
NAMES = {  # a law of your own is called as you call it
    "observer_free": "Observer-free",
    "classical": "Classical",
    "adaptive": "Adaptive",
    "super_twisting": "Super-twisting",
    "super_twisting_unclamped": "Super-twisting, unclamped",
    "conditioned_super_twisting": "Conditioned super-twisting",
    "boundary_layer": "Boundary layer",
    "adaptive_leak": "Adaptive + leak",
    "none": "No control",
}
INK, MUTED, GRID, PAPER, FAILED = "#1F2429", "#646C75", "#E3E6E9", "#FFFFFF", "#A9AFB6"
DISTURBANCE, BAND, RULE = "#3A3F46", "#DDE1E5", "#B9BFC5"
# Friction and contact: of a grid of colours one of the farthest in CIELAB from the laws', the disturbance's and
# paper, as seen with any colour blindness (G. M. Machado et al., IEEE TVCG 15(6), 2009).
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
    """A context in which matplotlib draws in this style."""
    from matplotlib import rc_context

    return rc_context(RC)  # pyright: ignore[reportArgumentType]


def law_colour(law: str) -> str:
    """The colour of a law, "#RRGGBB"; a law of your own always gets the same one."""
    return COLOURS.get(law, OTHERS[zlib.crc32(law.encode()) % len(OTHERS)])


def colours(traces: Sequence[Trace]) -> list[str]:
    """One colour a trace: its law's, or another where an earlier trace has taken that."""
    return law_colours([trace.scenario.law.name for trace in traces])


def law_colours(laws: Sequence[str]) -> list[str]:
    """One colour for each of these laws in one picture: its own, or another where an earlier one has taken that."""
    wanted = [law_colour(law) for law in laws]
    free = [c for c in (*OTHERS, *COLOURS.values()) if c not in wanted]
    given: list[str] = []
    for colour in wanted:
        given.append(free.pop(0) if colour in given and free else colour)
    return given


def law_name(law: str) -> str:
    """A law's name as people write it."""
    return NAMES.get(law, law)


def labels(traces: Sequence[Trace], given: Sequence[str] | None) -> list[str]:
    """One label a trace: the given ones as they are, else the laws' names, numbered where a law comes again.

    Raises:
      ScenarioError: not as many labels as traces.
    """
    own = [trace.scenario.law.name for trace in traces]
    if given is not None:
        if isinstance(given, str) or len(given) != len(traces):
            raise ScenarioError(f"labels are {shown(given)} for {len(traces)} traces: give one string a trace")
        return [str(label) for label in given]
    names = [law_name(law) for law in own]
    return [n if names.count(n) == 1 else f"{n} {names[:i].count(n) + 1}" for i, n in enumerate(names)]


def ending(trace: Trace) -> str:
    """How a run ended before its time, "" if it did not: "diverged at 0.4 s" only where the plant went off."""
    if trace.diverged_at is None:
        return ""
    off = trace.failure is None or trace.failure.startswith(reference.LEFT_THE_WORLD)
    return f"{'diverged' if off else 'failed'} at {trace.diverged_at:.3g} s"


def jumps(traces: Sequence[Trace], names: Sequence[str]) -> dict[float, str]:
    """When plants change, s -> how, as "mass × 2"; with the labels in front where it is not all of them."""
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
    """DejaVu Sans, as matplotlib brings it, as a font of Pillow; letters `size` high."""
    import matplotlib
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(matplotlib.get_data_path(), "fonts", "ttf", name)), size)


def width(text: str, size: float, bold: bool = False) -> float:
    """How wide a text is, in the unit of the letters' size."""
    return font(10 * size, bold).getlength(text) / 10  # Pillow rounds small letters to pixels


def cropped(text: str, room: float, size: float, bold: bool = False) -> str:
    """The text, on one line, cut with an ellipsis where it is wider than the room."""
    text = cut = " ".join(text.split())
    while cut and width(cut if cut == text else f"{cut}…", size, bold) > room:
        cut = cut[:-1]
    return text if cut == text else f"{cut.rstrip()}…"


def same_plant(traces: Trace | Sequence[Trace]) -> list[Trace]:
    """The traces, or the single one, if they can share axes.

    Raises:
      ScenarioError: none, or of several plants.
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
    """The traces of each group of channels, of traces of one plant: what shares a pair of axes."""
    kinds = zip(*(groups(trace.scenario.plant) for trace in traces), strict=True)
    return {kind[0]: [cut(trace, group) for trace, group in zip(traces, kind, strict=True)] for kind in kinds}


def units(group: Group) -> dict[str, str]:
    """Units of the quantities x, v, u, s of a group's channels."""
    x = group.unit
    return {"x": x, "v": f"{x}/s", "u": EFFORT[x].replace(" ", "·"), "s": f"{x}/s"}


def quantity(group: Group) -> str:
    """What x is: "angle" or "position", and "free angle" where no actuator drives it."""
    return ("" if group.driven else "free ") + {"rad": "angle", "m": "position"}[group.unit]


def letter(group: Group) -> str:
    """What x is called: q where no actuator drives it, as in a law's y.q."""
    return "x" if group.driven else "q"


def plant_name(trace: Trace) -> str:
    """The plant's name as people write it; that of your own model as you do."""
    if trace.scenario.plant.direct:
        return trace.scenario.plant.name
    words = {"van": "Van", "der": "der", "pol": "Pol", "duffing": "Duffing"}
    name = " ".join(words.get(w, w) for w in trace.scenario.plant.name.split("_"))
    name += " oscillator" if name in ("Van der Pol", "Duffing") else ""
    return name[0].upper() + name[1:]


def rgb(colour: str) -> tuple[int, int, int]:
    """#RRGGBB as three numbers, 0 .. 255."""
    return tuple(bytes.fromhex(colour[1:]))  # pyright: ignore[reportReturnType]


def letters_on(colour: str) -> str:
    """White or ink, whichever reads better on a colour (luma of ITU-R BT.601)."""
    red, green, blue = rgb(colour)
    return INK if 0.299 * red + 0.587 * green + 0.114 * blue > 140 else PAPER


def short(value: float, digits: int = 2) -> str:
    """A number in few digits, without an exponent where it has fewer than seven: 0.25, 6, 280."""
    return f"{float(f'{value:.{digits}g}'):g}"
