"""Style of figures and films: colours, labels, units and fonts.

Laws and plants state their labels in their own files. A law has one colour in nearly all pictures:
the one that its file states, of Okabe and Ito (Color Universal Design, 2008), which colour-blind
readers can tell apart; or else one of `palette`. Matplotlib's petroff10 has only ten colours,
fewer than there are laws; two of them are the grey of failed runs, and one is the violet of
friction.
"""

import colorsys
import dataclasses
import functools
import itertools
import json
import math
import re
import zlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from smc_mujoco.common.errors import ScenarioError, items_of, shown
from smc_mujoco.common.text import capital, stated
from smc_mujoco.control import estimator as estimators
from smc_mujoco.control import surface as surfaces
from smc_mujoco.control.component import Component, Template
from smc_mujoco.control.law import all_laws
from smc_mujoco.mechanisms.plant import EFFORT, Plant, catalogue
from smc_mujoco.metrics.conventions import ChannelGroup, group_trace, groups
from smc_mujoco.metrics.once_per_trace import once_per_trace
from smc_mujoco.simulation.conditions import CONDITION_FIELDS
from smc_mujoco.simulation.scenario import Scenario
from smc_mujoco.simulation.signals import Fault, Jump, Push, Wind
from smc_mujoco.simulation.trace import Trace

INK = "#1F2429"
MUTED = "#646C75"
GRID = "#E3E6E9"
PAPER = "#FFFFFF"
FAILED = "#A9AFB6"
DISTURBANCE = "#3A3F46"
BAND = "#DDE1E5"
RULE = "#B9BFC5"
HUES = 36  # of the grid from which colours are chosen
# Friction and contact. Chosen from a grid as one of the farthest in CIELAB from the laws' colours,
# the disturbance's and paper, with any colour blindness (G. M. Machado et al., IEEE TVCG 15(6),
# 2009).
REACTION = "#9018F0"
NEUTRAL = (PAPER, INK, DISTURBANCE, REACTION, FAILED)  # colours that no law has
DARK_PAGE = 0.2  # luminance of the darkest light page; chosen
LOG_RANGE = 5.0  # largest over smallest value above which an axis may be logarithmic; chosen
MANY_DIGITS = 1e5  # from it on, matplotlib writes numbers with an exponent
# of units, by the power of 1000 that a number is given
PREFIXES = {-2: "M", -1: "k", 0: "", 1: "m", 2: "µ", 3: "n"}
# where a word begins in DCMotor, but not in LuGre
CAMEL = re.compile(r"(?:(?<=[a-z]{3})|(?<=[A-Z]{2}))([A-Z])(?=[a-z])")
# of runs of one law, in their order: Okabe and Ito's, which are told apart on light and dark pages
RUN_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
MARKS = "osD^vPXh>*dp"  # of laws, for readers who see no colours; after twelve they begin again
# of the runs in a picture, in widths of a line, for the same readers; chosen
DASHES = [
    "-",
    (0, (6, 1.4)),
    (0, (5, 1.3, 1.2, 1.3)),
    (0, (1.5, 1.2)),
    (0, (5, 1.3, 1.2, 1.3, 1.2, 1.3)),
    (0, (3, 1)),
]
MAX_VALUES = 8  # numbers of a label
MAX_LETTERS = 50  # of what a label says of one field; chosen
MIN_DISTANCE = 15.0  # colours closer than this are mistaken for each other, see `distance`; chosen
LIGHTEST = 61.0  # lightness in CIELAB: up to it lines have a contrast of 3 : 1 to paper
LIGHTEST_RUN = 54.0  # of a law's runs: three are apart from each other and from failed ones
DARKEST = 21.0  # of a ramp
RAMP_ON_DARK = (90.0, 56.0)  # its ends on a dark page, to which all of it has a contrast of 4.5 : 1
# linear sRGB -> as it looks with all cones, no red, no green, no blue ones (Machado et al.)
SIGHTS = np.array([
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
])  # fmt: skip
XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.072175],
        [0.0193339, 0.119192, 0.9503041],
    ]
)

# Inches. A full page is 845 px of SVG, so that its least letters have 11 px in 800 px, as in a
# README. Letters of narrower pages than a journal's have 8 points, those of slides 16.
FULL_WIDTH = 8.8
JOURNAL_WIDTH = 8.5
SLIDE_WIDTH = 13.3
RC = {
    "font.family": "DejaVu Sans",
    "font.size": 10.5,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.facecolor": PAPER,
    "axes.titlecolor": INK,
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
    "axes.formatter.useoffset": False,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelsize": 9.5,
    "ytick.labelsize": 9.5,
    "legend.frameon": False,
    "lines.linewidth": 1.5,
    "lines.markersize": 6.0,
    "lines.solid_capstyle": "round",
    "figure.facecolor": PAPER,
    "savefig.facecolor": PAPER,
    "svg.fonttype": "path",
    "pdf.fonttype": 42,  # TrueType, as journals ask for
    "svg.hashsalt": "smc_mujoco",  # the same traces give the same file
}


def page(width: float = FULL_WIDTH):
    """Return a context in which matplotlib draws in this style, on a page of this width in inches.

    A full page has the letters and lines of RC. On journal pages and columns they are smaller, with
    letters of 8 points, on slides larger, with letters of 16.
    """
    from matplotlib import rc_context

    if width < JOURNAL_WIDTH:
        letters = 8.0
    elif width >= SLIDE_WIDTH:
        letters = 16.0
    else:
        letters = RC["font.size"]
    scale = letters / RC["font.size"]
    keys = ("size", "linewidth", "markersize")
    on_dark = neutral_on_dark()
    scaled: Any = {}
    for key, value in RC.items():
        if key.endswith(keys):
            scaled[key] = value * scale
        else:
            scaled[key] = on_dark.get(value, value)
    return rc_context(scaled)


def neutral_on_dark() -> dict[Any, str]:
    """Return the neutral colours of this style -> those on the caller's page, if that is dark, as
    in `plt.style.context("dark_background")`; {} on a light page.
    """
    from matplotlib import rcParams
    from matplotlib.colors import to_hex

    if rcParams["axes.facecolor"] == "none":
        return {}
    paper = to_hex(rcParams["axes.facecolor"]).upper()
    if luminance(paper) > DARK_PAGE:
        return {}
    ink = to_hex(rcParams["text.color"]).upper()
    shares = {GRID: 0.16, BAND: 0.25, RULE: 0.4, FAILED: 0.55, MUTED: 0.7, DISTURBANCE: 0.85}
    mixtures = {}
    for colour, share in shares.items():
        mixtures[colour] = mixed(paper, ink, share)
    return {PAPER: paper, INK: ink, **mixtures}


def points(size: float) -> float:
    """Return a size in points on this page, given the size on a full page."""
    from matplotlib import rcParams

    return size * rcParams["font.size"] / RC["font.size"]


def law_colour(law: Component | str) -> str:
    """Return the colour of a law, "#RRGGBB": its own, or that of its place in the palette."""
    template, name = _template(law)
    if template and template.colour:
        return template.colour
    chosen = palette()["chosen"]
    colours = list(chosen.values())
    return chosen.get(name) or colours[zlib.crc32(name.encode()) % len(colours)]


def trace_colours(traces: Sequence[Trace]) -> list[str]:
    """Return one colour per trace, that of its law; of one law's several runs beside others shades
    of it, from light to dark; of runs that are all of one law a colour each, by their order.
    """
    count = len(traces)
    if count > 1 and len({_template(trace.scenario.law)[1] for trace in traces}) == 1:
        more = _farthest([*RUN_COLOURS, *NEUTRAL], max(0, count - len(RUN_COLOURS)))
        return [*RUN_COLOURS, *more][:count]
    colours = law_colours([trace.scenario.law for trace in traces])
    colour_by_trace = []
    for i, colour in enumerate(colours):
        shades = [colour]
        if colours.count(colour) > 1:
            shades = ramp(colour, colours.count(colour), LIGHTEST_RUN)
        colour_by_trace.append(shades[colours[:i].count(colour)])
    return colour_by_trace


def law_colours(laws: Sequence[Component | str]) -> list[str]:
    """Return one colour per law for one picture, all laws' different.

    The library's laws have their colours, in pictures of two and of many. Only one that would be
    mistaken for a law that is before it in the palette, wherever they stand, gets the colour
    farthest from all: any 12 laws are then 13.7 apart, 24 are 9.6. Laws that are not of the
    library, whose colours say nothing, come after them. A law that runs several times has one
    colour here.
    """
    names = [_template(law)[1] for law in laws]
    everyone = range(len(laws))
    places = dict.fromkeys(palette()["stated"], 0)
    for place, name in enumerate(palette()["chosen"], 1):
        places[name] = place
    library = []
    for i in everyone:
        if names[i] in places:
            library.append(i)
    library.sort(key=lambda i: (places[names[i]], names[i]))
    colours: dict[int, str] = {}
    changed = []
    for i in dict.fromkeys([*library, *everyone]):
        own_colour = law_colour(laws[i])
        if names.index(names[i]) < i:  # it has the colour of the first
            continue
        if any(distance(own_colour, taken) < MIN_DISTANCE for taken in colours.values()):
            changed.append(i)
        else:
            colours[i] = own_colour
    new_colours = _farthest([*colours.values(), *NEUTRAL], len(changed))
    colours |= zip(sorted(changed), new_colours, strict=True)
    return [colours[names.index(name)] for name in names]


def looks(traces: Sequence[Trace]) -> list[dict[str, Any]]:
    """Return the look of the line of each trace in a picture, its dashes, which tell it from the
    others without colour.
    """
    return [{"ls": DASHES[i % len(DASHES)]} for i in range(len(traces))]


@functools.cache
def palette() -> dict[str, dict[str, str]]:
    """Return the colours of the library's laws: those that they state, and those chosen for the
    others, each the farthest from all before it.

    The usual laws are first, then baselines. A law without a colour here gets one by its name.
    """
    file = Path(__file__).with_name("law_colours.json")
    return json.loads(file.read_text(encoding="utf-8"))


def spread(count: int) -> list[str]:
    """Return colours, each the farthest from the neutral ones and from all before it."""
    return _farthest(NEUTRAL, count)


def _farthest(used: Sequence[str], count: int) -> list[str]:
    """Return so many colours of the grid, each the one whose least `distance` to the used ones and
    to those before it is largest.
    """
    seen = map(_as_each_sight, _grid())
    grid = np.array(list(seen))
    chosen = list(used)
    for _ in range(count):
        beside = np.array(list(map(_as_each_sight, chosen)))
        distances = np.linalg.norm(grid[:, None] - beside, axis=-1)
        apart = distances.min(axis=(1, 2))
        farthest = int(apart.argmax())
        chosen.append(_grid()[farthest])
    return chosen[len(used) :]


@functools.cache
def _grid() -> list[str]:
    """Return a grid of colours that are neither pale nor dull."""
    grid = []
    parts = itertools.product(range(HUES), (0.24, 0.33, 0.42, 0.51, 0.6), (0.45, 0.7, 0.95))
    for hue, lightness, saturation in parts:
        shade = colorsys.hls_to_rgb(hue / HUES, lightness, saturation)
        numbers = bytes(round(255 * part) for part in shade)
        colour = "#" + numbers.hex().upper()
        if _as_each_sight(colour)[0][0] < LIGHTEST:
            grid.append(colour)
    return grid


@functools.cache
def _as_each_sight(colour: str) -> np.ndarray:
    """Return a colour in CIELAB (D65) as each of SIGHTS sees it, (4, 3)."""
    seen = np.clip(SIGHTS @ _linear(colour), 0.0, 1.0)
    t = seen @ XYZ.T / XYZ.sum(axis=1)
    straight = t / (3 * (6 / 29) ** 2) + 4 / 29
    bright = t > (6 / 29) ** 3
    x, y, z = np.where(bright, np.cbrt(t), straight).T
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)]).T


def _linear(colour: str) -> np.ndarray:
    """Return the linear red, green and blue of a colour of sRGB, 0 .. 1."""
    c = np.array(rgb(colour)) / 255
    curved = ((c + 0.055) / 1.055) ** 2.4
    return np.where(c <= 0.04045, c / 12.92, curved)


def distance(one: str, other: str) -> float:
    """Return the least distance of two colours in CIELAB over normal sight and three kinds of
    colour blindness.
    """
    apart = _as_each_sight(one) - _as_each_sight(other)
    return float(np.linalg.norm(apart, axis=1).min())


def law_name(law: Component | str) -> str:
    """Return a law's label: its own, or its name in words. A user's law keeps the user's name."""
    template, name = _template(law)
    return (template and template.label) or (in_words(name) if name in all_laws() else name)


def run_name(trace: Trace) -> str:
    """Return the label of a run's law; where servos hold the joints without one, "Servo alone"."""
    law = trace.scenario.law
    held = any(group.is_set_point for group in groups(trace.scenario))
    return "Servo alone" if held and law.name == "none" else law_name(law)


def label(name: str) -> str:
    """Return the label of the library's law, surface or estimator of this name; other words
    unchanged.
    """
    named_parts = surfaces.catalogue() | estimators.catalogue()
    if name in all_laws():
        return law_name(name)
    return in_words(name) if name in named_parts else name


def _template(law: Component | str) -> tuple[Template | None, str]:
    """Return the template of a law, if there is one, and the law's name."""
    if isinstance(law, str):
        return all_laws().get(law), law
    return law.template or all_laws().get(law.name), law.name


def titled(title: object, default: str) -> str:
    """Return the title that a user gives, on one line, or for None the default."""
    if title is None:
        return default
    line = " ".join(title.split()) if isinstance(title, str) else "\n"
    if not line.isprintable():
        raise ScenarioError(f"title is {shown(title)}: give a text")
    return line


def in_words(name: str) -> str:
    """Return an identifier as words: boundary_layer as "Boundary layer"."""
    return capital(name.replace("_", " "))


def labels(traces: Sequence[Trace], own_labels: Sequence[str] | None) -> list[str]:
    """Return one label per trace: the given ones, else the laws' labels, with what differs between
    runs of one law.

    Machines whose parameters differ have these in their labels, whatever their laws. Equal labels
    are numbered.
    """
    if own_labels is not None:
        own_labels = items_of("labels", own_labels)
        if len(own_labels) != len(traces):
            raise ScenarioError(
                f"labels are {shown(own_labels)} for {len(traces)} traces: give one string a trace"
            )
        texts = []
        for label in own_labels:
            texts.append(label if isinstance(label, str) else shown(label))
        return texts
    names = list(map(run_name, traces))
    label_texts = []
    for trace, name in zip(traces, names, strict=True):
        words = differences(trace, traces)
        label_texts.append(f"{name}: {words}" if words else name)
    return numbered(label_texts)


def numbered(names: Sequence[str]) -> list[str]:
    """Return names, equal ones with numbers behind them."""
    apart = []
    for i, name in enumerate(names):
        is_repeated = names.count(name) > 1
        apart.append(f"{name} {names[:i].count(name) + 1}" if is_repeated else name)
    return apart


def differences(trace: Trace, others: Sequence[Trace]) -> str:
    """Return how a run differs from those of its law, and its machine from all, as "k1 = 6, no
    noise, m = 0.7".

    Where the condition differs, its name replaces the fields that are equal in all its runs.
    """
    scenario = trace.scenario
    law = run_name(trace)
    alike = []
    same = []
    for run in others:
        if run_name(run) == law:
            alike.append(run)
            if run.scenario.condition == scenario.condition:
                same.append(run)
    parts = []
    for name, words in _settings(trace).items():
        runs = same if name in CONDITION_FIELDS else alike
        if any(_settings(run).get(name) != words for run in runs):
            parts.append(_few(words))
    for name, words in _parameters(trace).items():
        # a payload is a parameter only where a mismatch names it
        if any(_parameters(run).get(name) != words for run in others):
            parts.append(f"plant's {words}" if name in scenario.law.gains else words)
    return ", ".join(parts)


def _few(words: str) -> str:
    """Return what a label says of a field, without its last items if it is long."""
    if len(words) <= MAX_LETTERS:
        return words
    shortened, _, _ = words[: MAX_LETTERS + 1].rpartition(",")
    return shortened or words


def _as_words(values: Mapping[str, Any]) -> dict[str, str]:
    return {name: _setting(name, value) for name, value in values.items()}


@once_per_trace
def _settings(trace: Trace) -> Mapping[str, str]:
    """Return the condition and the gains of a run, and the other fields of its scenario, in
    words.
    """
    scenario = trace.scenario
    values = {"condition": scenario.condition, **scenario.law.gains}
    for name in Scenario.fields():
        if name not in ("law", "plant", "mismatch"):
            values[name] = getattr(scenario, name)
    words = _as_words(values)
    if scenario.plant.is_user_model:  # whose file may have some
        words["friction"] = _setting("added friction", scenario.friction)
    return words


def _parameters(trace: Trace) -> dict[str, str]:
    """Return the true parameters of a run's machine in words."""
    true = vars(trace.scenario.plant.values(trace.scenario.mismatch))
    return _as_words(true)


def distinct(names: Sequence[str]) -> list[str]:
    """Return labels without the law that all of them begin with: "k = 1", "k = 2" of "Twisting: k =
    1", ...
    """
    law = f"{names[0].partition(': ')[0]}: "
    if all(name.startswith(law) for name in names):
        return [name.removeprefix(law) for name in names]
    return list(names)


def _setting(name: str, value: object) -> str:
    """Return a gain or a field of a scenario in words."""
    words = name.replace("_", " ")
    if name == "condition":
        return str(value).replace("_", " ")
    if isinstance(value, Jump | Fault):
        return value.text
    if value is True:
        return words
    if value in (None, False, ()) and not isinstance(value, int | float):
        return f"no {words}"
    text = _value(value).removeprefix(f"{capital(words)}, ")  # a noise is a Noise
    if text == capital(words):
        return f"no {words}"
    first = value[0] if isinstance(value, tuple) else value
    return f"{words} = {text}" if isinstance(first, int | float) else f"{words} {text}"


def _value(value: object) -> str:
    """Return a value of a field in words, such as "0.5", "Coulomb 0.005" or "Encoder, counts
    2000".
    """
    if isinstance(value, int | float):
        return f"{value:.6g}"
    if isinstance(value, tuple):
        parts = value[:1] if len(set(value)) == 1 else value
        few = ", ".join(map(_value, parts))
        return few if len(parts) <= MAX_VALUES else f"{len(value)} values"
    if isinstance(value, Component):
        return law_name(value)
    if not dataclasses.is_dataclass(value):
        return str(value).replace("_", " ")
    kind = re.sub(CAMEL, lambda start: f" {start[1].lower()}", type(value).__name__)
    words = [kind]
    alone = len(stated(value)) == 1
    for name, part in stated(value, defaults=False).items():
        said = _value(part)
        words.append(said if alone else f"{name.replace('_', ' ')} {said}")
    return (" " if alone else ", ").join(words)


def ending(trace: Trace) -> str:
    """Return how a run failed: "diverged at 0.4 s" (the plant) or "failed at 0.4 s" (its law); ""
    if it did not.
    """
    if trace.diverged_at is None:
        return ""
    return f"{'diverged' if trace.plant_diverged else 'failed'} at {trace.diverged_at:.3g} s"


class Event(NamedTuple):
    """A change of a plant, for good, a blow or a gust, from `time` to `stop`, s, in words."""

    time: float
    stop: float
    words: str
    kind: str = "change"


def events(traces: Sequence[Trace], names: Sequence[str]) -> list[Event]:
    """Return the changes of plants, the blows on bodies and the gusts, such as "mass × 2", "blow of
    400 N" and "gust of 5 m/s", in the order of their times.

    The labels of the runs precede what only some of them have, where these do not say so.
    """
    who_at: dict[Event, list[str]] = {}
    for trace, name in zip(traces, names, strict=True):
        happened = set()
        if jump := trace.scenario.jump:
            words = trace.scenario.plant.change(jump.factors)
            happened.add(Event(jump.time, math.inf, words))
        if fault := trace.scenario.fault:
            happened.add(Event(fault.at, math.inf, fault.words))
        for push in pushes([trace]):
            force = math.hypot(push.x, push.y, push.z)
            size = short(force)
            end = push.time + push.width
            happened.add(Event(push.time, end, f"blow of {size} N", "blow"))
        for wind in trace.scenario.disturbance:
            if isinstance(wind, Wind) and wind.width:
                speed = short(math.hypot(wind.x, wind.y, wind.z))
                end = wind.time + wind.width
                happened.add(Event(wind.time, end, f"gust of {speed} m/s", "gust"))
        for event in happened:
            who_at.setdefault(event, []).append(name)
    told_events = []
    for event, who in sorted(who_at.items()):
        if len(who) < len(traces) and not all(event.words in name for name in who):
            told_events.append(event._replace(words=f"{', '.join(who)}: {event.words}"))
        else:
            told_events.append(event)
    return told_events


def marks(happened: Sequence[Event]) -> dict[float, str]:
    """Return what happened by its time, s, in words: "mass × 2", "blow of 400 N for 20 ms"."""
    words: dict[float, str] = {}
    for event in happened:
        said = event.words
        if math.isfinite(event.stop):
            said += f" for {1e3 * (event.stop - event.time):.4g} ms"
        words[event.time] = f"{words[event.time]}; {said}" if event.time in words else said
    return words


def pushes(traces: Sequence[Trace]) -> list[Push]:
    """Return the blows on bodies of arms and of users' models, which no d of a trace has."""
    body_pushes = []
    for trace in traces:
        plant = trace.scenario.plant
        if plant.tip or plant.has_user_joints:
            for push in trace.scenario.disturbance:
                if isinstance(push, Push):
                    body_pushes.append(push)
    return body_pushes


@functools.cache
def font(size: float, bold: bool = False):
    """Return DejaVu Sans, which comes with matplotlib, as a font of Pillow with letters `size`
    high.
    """
    import matplotlib
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    folder = matplotlib.get_data_path()
    return ImageFont.truetype(Path(folder, "fonts", "ttf", name), size)


def width(text: str, size: float, bold: bool = False) -> float:
    """Return the width of a text, in the unit of `size`, the height of its letters."""
    return font(10 * size, bold).getlength(text) / 10  # Pillow rounds small letters to pixels


def widest(lines: Iterable[str], size: float) -> float:
    """Return the width of the widest of these lines, in the unit of `size`."""
    return max(width(line, size) for line in lines)


def cropped(text: str, room: float, size: float, bold: bool = False) -> str:
    """Return the text on one line, with an ellipsis at its end if it is wider than the room."""
    text = " ".join(text.split())
    if width(text, size, bold) <= room:
        return text
    while text and width(f"{text}…", size, bold) > room:
        text = text[:-1]
    return f"{text.rstrip()}…"


def wrapped(text: str, room: float, size: float, lines: int, bold: bool = False) -> str:
    """Return the text on at most `lines` lines, broken between words, with an ellipsis at its end
    if it is too long.

    A number and a short word after it, such as its unit, stay together.
    """
    broken = []
    words = re.split(r"(?<!\d)\s+|\s+(?!\S{1,4}(?:\s|$))", text.strip())
    while words and len(broken) < lines - 1:
        count = len(words)
        while count > 1 and width(" ".join(words[:count]), size, bold) > room:
            count -= 1
        line = " ".join(words[:count])
        broken.append(cropped(line, room, size, bold))
        words = words[count:]
    if words:
        line = cropped(" ".join(words), room, size, bold)
        broken.append(line)
    return "\n".join(broken)


def folded(label: str, room: float = 120.0) -> str:
    """Return an axis's label on up to four lines of a room in points, broken after underscores
    too.
    """
    breakable = label.replace("_", "_ ")
    letters = points(RC["font.size"])
    return wrapped(breakable, room, letters, 4).replace("_ ", "_")


def traces_of_one_plant(traces: Trace | Sequence[Trace]) -> list[Trace]:
    """Return the traces as a list; refuse those that cannot share axes."""
    if isinstance(traces, str):
        raise ScenarioError(
            f"traces is {shown(traces)}, no trace: give what smc.run or smc.load returns"
        )
    traces = [traces] if isinstance(traces, Trace | Scenario) else items_of("traces", traces)
    for item in traces:
        if not isinstance(item, Trace):
            raise ScenarioError(
                f"traces has {shown(item)}, no trace: give what smc.run or smc.load returns"
            )
    if not traces:
        raise ScenarioError(
            "no traces to draw: give at least one, from smc.run(...) or smc.load(...)"
        )
    plants = sorted({trace.scenario.plant.name for trace in traces})
    if len(plants) > 1:
        raise ScenarioError(
            f"traces of {' and '.join(plants)} share no axes: draw one plant at a time, "
            f"such as [t for t in traces if t.scenario.plant.name == {plants[0]!r}]"
        )
    kinds = set()
    for trace in traces:
        kind = tuple((group.name, group.unit) for group in groups(trace.scenario))
        kinds.add(kind)
    if len(kinds) > 1:
        raise ScenarioError(
            f"traces of {plants[0]} differ in their kinds of channels: "
            "draw those with the same ones at a time"
        )
    if len(units := sorted({trace.scenario.efforts[0] for trace in traces})) > 1:
        raise ScenarioError(
            f"traces of {plants[0]} have u in {' and '.join(units)}: "
            "draw those of one unit at a time"
        )
    return traces


def split(traces: Sequence[Trace]) -> dict[ChannelGroup, list[Trace]]:
    """Return the traces of each group of channels, which share a pair of axes.

    All traces are of one plant.
    """
    kinds = zip(*(groups(trace.scenario) for trace in traces), strict=True)
    parts = {}
    for kind in kinds:
        parts[kind[0]] = list(map(group_trace, traces, kind))
    return parts


def units(group: ChannelGroup) -> dict[str, str]:
    """Return the units of x, v, u and s of a group's channels, and of a force on them."""
    x = group.unit
    u = group.effort.replace(" ", "·")
    force = EFFORT[x].replace(" ", "·")
    speed = f"{x.removesuffix('/s')}/s"
    return {"x": x, "v": speed, "u": u, "s": speed, "force": force}


def plant_name(plant: Plant | str, short: bool = False) -> str:
    """Return the plant's label: its own, or its name in words.

    A user's model keeps the user's name.
    """
    if isinstance(plant, str):
        library_plant = catalogue().get(plant)
        return plant_name(library_plant, short) if library_plant else plant
    if short and plant.short:
        return plant.short
    return plant.label or (plant.name if plant.is_user_model else in_words(plant.name))


def head(scenarios: Sequence[Scenario]) -> str:
    """Return what a picture of runs is about: their plant, and their condition if all have the same
    one with a name.
    """
    return heading(
        [scenarios[0].plant], [scenario.condition or "nominal" for scenario in scenarios]
    )


def heading(
    plants: Sequence[Plant | str], conditions: Sequence[str] = (), short: bool = False
) -> str:
    """Return plants, and the condition if there is only one, which is not the nominal one."""
    plant_names = dict.fromkeys(plant_name(plant, short) for plant in plants)
    head = ", ".join(plant_names)
    if len(set(conditions)) == 1 and conditions[0] != "nominal":
        return under(head, condition_name(conditions[0]))
    return head


def under(title: str, condition: str) -> str:
    """Return a title followed by the condition, unless it names that already."""
    named = re.search(rf"\b{re.escape(condition)}\b", title, re.IGNORECASE)
    return title if named else f"{title}, {condition}"


def condition_name(condition: str) -> str:
    """Return a condition as pictures and LaTeX name it, such as "delay 10 ms"."""
    return re.sub(r"(?<=\d)ms\b", " ms", condition.replace("_", " "))


def prefixed(largest: float, unit: str) -> tuple[float, str]:
    """Return a factor and the unit with a prefix, with which values up to `largest` need no
    exponent.
    """
    if 0.0 < largest < 0.1 or largest >= MANY_DIGITS:
        power = -math.floor(math.log10(largest) / 3.0)
    else:
        power = 0
    power = min(max(power, min(PREFIXES)), max(PREFIXES))
    return 1e3**power, PREFIXES[power] + unit


def rgb(colour: str) -> tuple[int, int, int]:
    """Return #RRGGBB as three numbers, 0 .. 255."""
    return tuple(bytes.fromhex(colour[1:]))  # pyright: ignore[reportReturnType]


def mixed(colour: str, other: str, share: float) -> str:
    """Return a colour mixed with this share of another."""
    pairs = zip(rgb(colour), rgb(other), strict=True)
    numbers = bytes(round(a + share * (b - a)) for a, b in pairs)
    return "#" + numbers.hex().upper()


def ramp(colour: str, count: int, lightest: float = LIGHTEST) -> list[str]:
    """Return shades of a colour from light to dark, in equal steps of lightness; all are light on a
    dark page.
    """
    ends = RAMP_ON_DARK if neutral_on_dark() else (lightest, DARKEST)
    shades = []
    for end_colour in (PAPER, "#000000"):
        for share in np.linspace(0.0, 0.95, 96):
            shades.append(mixed(colour, end_colour, share))
    values = [_as_each_sight(shade)[0][0] for shade in shades]
    lightness = np.array(values)
    target_lightness = np.linspace(*ends, count)
    misses = np.abs(lightness - target_lightness[:, None])
    nearest = misses.argmin(axis=1)
    return [shades[i] for i in nearest]


def luminance(colour: str) -> float:
    """Return the relative luminance of WCAG 2.2, 0 for black and 1 for white."""
    shares = np.array([0.2126, 0.7152, 0.0722])
    return float(shares @ _linear(colour))


def short(value: float, digits: int = 2) -> str:
    """Return a number with few digits, such as 0.25, 6, 280; with an exponent from 1e6 on and below
    1e-4.
    """
    return f"{float(f'{value:.{digits}g}'):g}"
