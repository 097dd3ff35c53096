"""Tables of text, with writers for a terminal, for plain text of 80 columns, for notebooks and for
LaTeX.

    table = Tabular(headings=["law", "ITAE (m s^2)"], rows=[["pid", Cell("1.2", "1.1–1.3")]])
    print(table)
    table.to_latex()

A table that is wider than the terminal is shown in several parts, each with the columns at the
left.
"""

import io
import itertools
import math
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from decimal import Decimal
from typing import TYPE_CHECKING, NamedTuple

from smc_mujoco.common import html
from smc_mujoco.common.data import keyword_dataclass

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderableType
    from rich.text import Text

PLAIN_WIDTH = 80  # characters of a line of plain text
NAME_WIDTH = 20  # characters of a name before it is broken
HEADING_WIDTH = 8  # characters of a heading at least
NARROW_WIDTH = 12  # of a name, and of a line below a number, where space is short
# In LaTeX: widths of a character, of one in a line below, and of the narrowest words, em
TEX_CHARACTER = 0.5
TEX_SMALL = 0.43
TEX_WIDTH = 22
NEAR_POWERS = 2  # of ten, between the ends of an interval; beyond, its lower end is a bound
MAX_HTML_ROWS = 40
NEEDS = r"needs booktabs; \footnotesize\setlength{\tabcolsep}{2pt} before it makes it narrower"
NO_BREAK = "\N{NO-BREAK SPACE}"
# A character -> as LaTeX writes it, with any engine.
TEX = {c: f"\\{c}" for c in "&%$#_{}"} | {c: f"${c}$" for c in "<>|"}
TEX |= {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
}
TEX |= {"–": "--", "·": r"$\cdot$", "×": r"$\times$", "±": r"$\pm$", "−": "$-$"}
TEX |= {"′": "$'$", "″": "$''$", NO_BREAK: "~"}
LETTERS = "αβγδεζηθικλμνξπρστυφχψωΓΔΘΛΞΠΣΦΨΩ"
LETTER_NAMES = (
    "alpha beta gamma delta varepsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau "
    "upsilon"
)
LETTER_NAMES += " varphi chi psi omega Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega"
TEX |= {letter: f"$\\{name}$" for letter, name in zip(LETTERS, LETTER_NAMES.split(), strict=True)}
for digit, (lower, upper) in enumerate(zip("₀₁₂₃₄₅₆₇₈₉", "⁰¹²³⁴⁵⁶⁷⁸⁹", strict=True)):
    TEX[lower] = f"$_{digit}$"
    TEX[upper] = f"$^{digit}$"


class Cell(NamedTuple):
    """A text with a smaller one below it, such as a median and its interval."""

    text: str
    below: str = ""  # further lines
    strong: bool = False  # marked: bold, and with a star where letters have no weight
    colour: str = ""  # in a terminal, as rich names it
    alarm: str = ""  # a last line, such as how many runs failed
    label: str = ""  # what LaTeX prints instead of the text


@keyword_dataclass
class Tabular:
    """A table."""

    headings: Sequence[str]
    rows: Sequence[Sequence[Cell | str]]
    title: str = ""
    notes: Sequence[str] = ()  # paragraphs below the table
    name_columns: int = 1  # columns of names, which are aligned to the left
    label: str = ""  # what LaTeX prints instead of the title
    under: Sequence[str] = ()  # paragraphs that LaTeX prints below the table

    def __str__(self) -> str:
        return plain(self)

    def __rich_console__(
        self, console: "Console", options: "ConsoleOptions"
    ) -> "Iterator[RenderableType]":
        from rich import box
        from rich.table import Table
        from rich.text import Text

        columns = self._columns(options.max_width)
        if self.title:
            yield Text(self.title, "bold")
        for part in _parts(list(map(_widest, columns)), options.max_width, self.name_columns):
            bodies = []
            for i in part:
                bodies.append(columns[i][1:])
            tall = any("\n" in cell.plain for cell in itertools.chain.from_iterable(bodies))
            table = Table(
                box=box.HORIZONTALS if tall else box.SIMPLE_HEAD,  # rules between tall rows
                show_lines=tall,
                padding=0,
                pad_edge=False,
                show_edge=False,
            )
            lines = max(columns[i][0].plain.count("\n") for i in part)
            for i in part:
                head = columns[i][0]
                above = Text("\n" * (lines - head.plain.count("\n")))
                side = "left" if i < self.name_columns else "right"
                table.add_column(above.append_text(head), justify=side, overflow="fold")
            for row in zip(*bodies, strict=True):
                table.add_row(*row)
            yield table
        for note in self.notes:
            yield Text(note)

    def _columns(self, width: int) -> "list[list[Text]]":
        """Return the columns of names, then those of numbers. Where space is short the widest
        numbers are narrow; where it is for names alone, the first of these.
        """
        names = list(map(self._names, range(self.name_columns)))
        for i in range(self.name_columns):
            if sum(map(_widest, names)) + self.name_columns - 1 > width:
                names[i] = self._names(i, NARROW_WIDTH)
        numbers = range(self.name_columns, len(self.headings))
        columns = list(map(self._column, numbers))
        narrow = [self._column(i, narrow=True) for i in numbers]
        while sum(map(_widest, [*names, *columns])) + len(self.headings) - 1 > width:
            savings = []
            for wide, narrower in zip(columns, narrow, strict=True):
                savings.append(_widest(wide) - _widest(narrower))
            if max(savings, default=0) <= 0:
                break
            widest = savings.index(max(savings))
            columns[widest] = narrow[widest]
        return [*names, *columns]

    def _names(self, i: int, width: int = NAME_WIDTH) -> "list[Text]":
        """Return the heading and the cells of a column of names, broken beyond a width."""
        from rich.text import Text

        texts = [Text(self.headings[i])]
        for row in self.rows:
            cell = as_cell(row[i])
            name = Text(folded(cell.text, width), cell.colour)
            if cell.below:
                name.append(f"\n{cell.below}", "dim")
            texts.append(name)
        return texts

    def _column(self, i: int, narrow: bool = False) -> "list[Text]":
        """Return the heading and the cells of a column of numbers.

        If `narrow`, the lines below its numbers are broken, an interval after its dash.
        """
        from rich.text import Text

        cells = [as_cell(row[i]) for row in self.rows]
        if narrow:
            cells = [cell._replace(below=_narrow(cell.below)) for cell in cells]
        pad = " " if any(cell.strong for cell in cells) else ""  # below the stars
        texts = []
        for cell in cells:
            text = Text(cell.text + pad, cell.colour)
            if cell.strong:
                text = Text(f"{cell.text}*", f"bold {cell.colour}".strip())
            for lines, style in ((cell.below, "dim not bold"), (cell.alarm, "red not bold")):
                for line in lines.splitlines():
                    text.append(f"\n{line}{pad}", style)
            texts.append(text)
        return [Text(self._heading(i, max(map(_width, texts), default=0))), *texts]

    def _heading(self, i: int, width: int) -> str:
        """Return a heading on lines as wide as the cells of its column; a unit stays whole."""
        unbroken = re.sub(r"\(.*\)", lambda unit: unit[0].replace(" ", NO_BREAK), self.headings[i])
        return _wrapped(unbroken, max(HEADING_WIDTH, width))

    def _repr_html_(self) -> str:
        lines = [list(map(_html, row)) for row in self.rows]
        note = html.Html("<br>".join(map(html.text, self.notes)))
        numbers = range(self.name_columns, len(self.headings))
        heads = [heading.replace("^2", "²") for heading in self.headings]
        return html.table(
            heads,
            lines,
            self.title,
            note,
            numbers,
            max_rows=MAX_HTML_ROWS,
        )

    def about(self) -> dict[str, object]:
        """Return the table as JSON data, with a list for each row; a number is a number."""
        rows = [list(map(_value, row)) for row in self.rows]
        return {
            "title": self.title,
            "columns": list(self.headings),
            "rows": rows,
            "notes": list(self.notes),
        }

    def to_latex(self) -> str:
        """Return a tabular, which needs the package booktabs, below comments with the notes; the
        title and the paragraphs `under` the table are in print.

        What stands below a number is in a further line of its row. Words below numbers become
        letters, which a line under the table explains.
        """
        marks = self._marks()
        widths = []
        heads = []
        columns = []
        for i in range(len(self.headings)):
            letters = marks if i >= self.name_columns else {}
            cells = [as_cell(row[i]) for row in self.rows]
            widest = max((_tex_width(cell, letters) for cell in cells), default=0.0)
            head = self._heading(i, math.ceil(widest / TEX_CHARACTER)).splitlines()
            widths.append(max([widest, *(TEX_CHARACTER * len(line) for line in head)]))
            heads.append([*map(tex, head)][::-1])
            columns.append([_tex_cell(cell, letters) for cell in cells])
        width = max(sum(widths), TEX_WIDTH)
        sides = "l" * self.name_columns + "r" * (len(self.headings) - self.name_columns)
        lines = [
            f"\\begin{{tabular}}{{{sides}}}",
            "\\toprule",
            *self._tex_words([self.label or self.title], width),
            "\\midrule",
            *_tex_lines(heads)[::-1],  # their last lines are level
            "\\midrule",
        ]
        rows = [_tex_lines(cells) for cells in zip(*columns, strict=True)]
        space = ["\\addlinespace"] if max(map(len, rows), default=0) > 1 else []
        for row in rows[:1]:
            lines += row
        for row in rows[1:]:
            lines += space + row
        lines.append("\\bottomrule")
        meanings = []
        for words, mark in marks.items():
            meanings.append(f"({mark}): {words}".replace(" ", NO_BREAK))
        lines += self._tex_words(["; ".join(meanings), *self.under], width)
        comments = commented("\n".join([*self.notes, NEEDS]))
        return "\n".join([comments, *lines, "\\end{tabular}\n"])

    def _marks(self) -> dict[str, str]:
        """Return words below numbers -> the letter that LaTeX prints instead."""
        marks: dict[str, str] = {}
        for row in self.rows:
            for value in row[self.name_columns :]:
                for line in _below(as_cell(value)):
                    if " " in line:
                        again, letter = divmod(len(marks), 26)
                        marks.setdefault(line, chr(ord("a") + letter) * (1 + again))
        return marks

    def _tex_words(self, paragraphs: Iterable[str], width: float) -> list[str]:
        """Return a row for each paragraph over all columns, which LaTeX breaks at a width, em."""
        gaps = 2 * (len(self.headings) - 1)
        wide = f"p{{\\dimexpr {width:.3g}em+{gaps}\\tabcolsep\\relax}}"
        lines = []
        for text in filter(None, paragraphs):
            words = tex(re.sub(r"(?<=\d) (?=%|ms\b)", NO_BREAK, text))
            cell = f"\\multicolumn{{{len(self.headings)}}}{{{wide}}}"
            lines.append(f"{cell}{{\\footnotesize\\raggedright {words}}} \\\\")
        return lines


class Tables:
    """Base of results that are shown as `tables` by `print`, in terminals and notebooks, and in
    LaTeX.
    """

    @property
    def tables(self) -> Sequence[Tabular]:
        """The tables, in their order."""
        raise NotImplementedError

    def __str__(self) -> str:
        return "\n\n".join(map(str, self.tables))

    def __repr__(self) -> str:
        return str(self)

    def __rich_console__(
        self, console: "Console", options: "ConsoleOptions"
    ) -> "Iterator[RenderableType]":
        for table in self.tables:
            yield table
            yield ""

    def _repr_html_(self) -> str:
        return "<br>".join(table._repr_html_() for table in self.tables)

    def to_latex(self) -> str:
        """Return a LaTeX tabular for each table, below comments that say what it shows; needs
        booktabs.
        """
        texts = []
        for table in self.tables:
            if table.rows:
                texts.append(table.to_latex())
        return "\n".join(texts)


def plain(shown: "RenderableType", width: int = PLAIN_WIDTH) -> str:
    """Return what rich prints, as text without colours."""
    from rich.console import Console

    console = Console(
        file=io.StringIO(),
        width=width,
        markup=False,
        emoji=False,
        highlight=False,
        color_system=None,
        force_terminal=False,
        force_jupyter=False,
    )
    console.print(shown)
    printed = console.file.getvalue()  # pyright: ignore[reportAttributeAccessIssue]
    return "\n".join(map(str.rstrip, printed.splitlines()))


def folded(name: str, width: int) -> str:
    """Return a name that is longer than a width on several lines, broken at spaces and after
    underscores.
    """
    if len(name) <= width:
        return name
    lines = []
    for line in textwrap.wrap(name.replace("_", "_ "), width):
        lines.append(line.replace("_ ", "_"))
    return "\n".join(lines)


def as_cell(cell: Cell | str) -> Cell:
    """Return a cell that may be a text alone."""
    return cell if isinstance(cell, Cell) else Cell(cell)


def _value(cell: Cell | str) -> object:
    """Return a cell as JSON data: a number, a text, or the parts of a cell of several lines."""
    if isinstance(cell, Cell) and (cell.below or cell.alarm or cell.strong):
        parts = {"text": _value(cell.text), "below": cell.below, "alarm": cell.alarm}
        return parts | {"strong": cell.strong}
    text = as_cell(cell).text
    try:
        return float(text)
    except ValueError:
        return text


def _wrapped(text: str, width: int) -> str:
    """Return a text on lines of a width, broken only at spaces that may break."""
    return "\n".join(textwrap.wrap(text, width, break_long_words=False)).replace(NO_BREAK, " ")


def _narrow(text: str) -> str:
    """Return a text on narrow lines; a number stays with its unit."""
    lines = re.sub(r"(\d) ", rf"\1{NO_BREAK}", text.replace("–", "–\n")).splitlines()
    narrow = [_wrapped(line, NARROW_WIDTH) for line in lines]
    return "\n".join(narrow)


def _width(text: "Text") -> int:
    """Return the width of the longest line."""
    return max((line.cell_len for line in text.split("\n")), default=0)


def _widest(column: "Sequence[Text]") -> int:
    return max(map(_width, column))


def _parts(widths: Sequence[int], width: int, names: int) -> list[list[int]]:
    """Return the columns of each part of a table that fits into a width; each part begins with the
    names.
    """
    name_columns = list(range(names))
    parts = [name_columns]
    for i, column_width in enumerate(widths[names:], names):
        last = parts[-1]
        taken = sum(widths[k] for k in last) + len(last)
        if len(last) > names and taken + column_width > width:
            last = name_columns
            parts.append(name_columns)
        parts[-1] = [*last, i]
    return parts


def _html(cell: Cell | str) -> str:
    """Return a cell as HTML, with the lines below in smaller letters."""
    cell = as_cell(cell)
    text = html.strong(cell.text) if cell.strong else html.text(cell.text)
    if below := "<br>".join(map(html.text, _below(cell))):
        return html.Html(f'{text}<br><small style="white-space:nowrap">{below}</small>')
    return text


def _below(cell: Cell) -> list[str]:
    """Return the lines below a cell's text."""
    return [*cell.below.splitlines(), *cell.alarm.splitlines()]


def _tex_lines(cells: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a row, from those of its cells."""
    lines = []
    for parts in itertools.zip_longest(*cells, fillvalue=""):
        lines.append(f"{' & '.join(parts)} \\\\")
    return lines


def _tex_width(cell: Cell, marks: Mapping[str, str]) -> float:
    """Return about the width of `_tex_cell`, em."""
    text = cell.label or cell.text
    widths = []
    for line in _below(cell):
        if line in marks:
            text += f" ({marks[line]})"
        else:
            widths.append(TEX_SMALL * len(line))
    return max(TEX_CHARACTER * len(text), *widths, 0.0)


def _tex_cell(cell: Cell, marks: Mapping[str, str]) -> list[str]:
    """Return the lines of a cell as LaTeX, those of `marks` as letters beside its text."""
    text = tex(cell.label or cell.text)
    if cell.strong:
        bold = "\\boldmath" if "$" in text else ""
        text = f"\\textbf{{{bold}{text}}}"
    below = []
    letters = []
    for line in _below(cell):
        if line in marks:
            letters.append(f"({marks[line]})")
        else:
            below.append(f"\\footnotesize {tex(line)}")
    if letters:
        text += f"~{{\\footnotesize {','.join(letters)}}}"
    return [text, *below]


def commented(text: str) -> str:
    """Return text as comments of LaTeX."""
    return "\n".join(f"% {line}".rstrip() for line in text.splitlines())


def tex(text: str) -> str:
    """Return text with LaTeX's special characters escaped, and numbers with exponents, powers,
    Greek letters, dashes and u_max in its notation.

    Both ends of an interval have the power of ten of the larger end; a lower end whose digits are
    far below those of the other is a bound.
    """

    def written(match: re.Match[str]) -> str:
        if match["number"]:
            return _with_power(match["number"], match["power"])
        if match["low"]:
            return _tex_interval(match["low"], match["of_low"], match["high"], match["of_high"])
        if match["raised"]:
            return f"$^{{{match['raised']}}}$"
        if match["bound"]:
            return r"$u_{\max}$"
        return TEX.get(match["letter"], match["letter"])

    low = r"(?P<low>[<-]?[\d.]+)e(?P<of_low>-?\d+)"
    interval = rf"{low}–(?P<high>-?[\d.]+)(?:e(?P<of_high>-?\d+))?"
    number = r"(?P<number>[<-]?[\d.]+)e(?P<power>-?\d+)"
    notation = r"\^(?P<raised>-?\d+)|(?P<bound>\bu_max\b)|(?P<letter>.)"
    return re.sub(rf"{interval}|{number}|{notation}", written, text)


def _with_power(number: str, power: str) -> str:
    return f"${number}\\cdot10^{{{power}}}$"


def _tex_interval(low: str, of_low: str, high: str, of_high: str | None) -> str:
    """Return an interval whose lower end has a power of ten."""
    shift = int(of_high or 0) - int(of_low)
    if of_high and shift < 0:
        return f"{_with_power(low, of_low)}--{_with_power(high, of_high)}"
    if of_high is None:
        digits = len(high.partition(".")[2])
        return f"$<${Decimal(1).scaleb(-digits):f}--{high}"
    if shift <= NEAR_POWERS:
        less = "$<$" if low.startswith("<") else ""
        first = f"{less}{Decimal(low.removeprefix('<')).scaleb(-shift)}"
    else:
        first = f"$<${10.0**-NEAR_POWERS:g}"
    return f"({first}--{high})$\\cdot10^{{{of_high}}}$"
