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
NAME_WIDTH = 20  # characters of a name, where space is short
HEADING_WIDTH = 8  # characters of a heading at least
NARROW_WIDTH = 12  # of a name, and of a line below a number, where space is short
# In LaTeX: widths of a character, of one in a line below, and of the narrowest words, em
TEX_CHARACTER = 0.5
TEX_SMALL = 0.43
TEX_WIDTH = 22
NEAR_POWERS = 2  # of ten, between the ends of an interval; beyond, its lower end is a bound
MAX_HTML_ROWS = 99
HTML_TABLE = "border-collapse:collapse;font-variant-numeric:tabular-nums;color:inherit"
HTML_TITLE = "caption-side:top;text-align:left;color:inherit;padding:2px 10px"
HTML_CELL = "padding:2px 10px;vertical-align:top;text-align:"
GAP = 2  # spaces between columns
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

    @property
    def starred(self) -> bool:
        """Whether a cell is marked."""
        return any(as_cell(cell).strong for cell in itertools.chain.from_iterable(self.rows))

    def __str__(self) -> str:
        return plain_text(self)

    def __rich_console__(
        self, console: "Console", options: "ConsoleOptions"
    ) -> "Iterator[RenderableType]":
        from rich.table import Table
        from rich.text import Text

        columns = self._columns(options.max_width)
        if self.title:
            yield Text(self.title, "bold")
        for part in _parts(list(map(_widest, columns)), options.max_width, self.name_columns):
            part_columns = [columns[i] for i in part]
            if part[-1] >= len(part):  # not the first one
                yield Text("")
            table = Table(
                box=None,
                padding=(0, GAP, 0, 0),
                pad_edge=False,
                header_style="",
                show_header=any(self.headings),
            )
            heights = [column[0].plain.count("\n") for column in part_columns]
            unitless = not any(" (" in self.headings[i] for i in part)
            for i, column, height in zip(part, part_columns, heights, strict=True):
                head = Text("\n" * (max(heights) - height)).append_text(column[0])
                if unitless:
                    head.right_crop(1)
                table.add_column(head, justify="left" if i < self.name_columns else "right")
            rows = list(zip(*(column[1:] for column in part_columns), strict=True))
            tall = any(map(_below, itertools.chain.from_iterable(self.rows)))
            for k, row in enumerate(rows):
                table.add_row(*row)
                if tall and k < len(rows) - 1:
                    table.add_row()
            yield table
        if self.rows and self.notes:
            yield Text("")
        for note in self.notes:
            yield Text(note)

    def _columns(self, width: int) -> "list[list[Text]]":
        """Return the columns of names, then those of numbers, each a heading and cells. Where space
        is short, names and then the widest numbers are narrow.
        """
        count = self.name_columns
        numbers = range(count, len(self.headings))
        columns = list(map(self._column, numbers))
        last = range(count - (not numbers), count)  # the last names may take what others leave
        room = width
        for i in last:
            room -= GAP + min(NAME_WIDTH, _widest(self._column(i, name=width)))
        names: list[list[Text]] = []
        for limit in range(width, NARROW_WIDTH, -1):
            names = [self._column(i, name=limit) for i in range(count - len(last))]
            if _total([*names, *columns] if limit > NAME_WIDTH else names) <= room:
                break
        rest = max(width - GAP - _total(names), NARROW_WIDTH)
        names += [self._column(i, name=rest) for i in last]
        narrow = [self._column(i, narrow=True) for i in numbers]
        while _total([*names, *columns]) > width:
            savings = [
                _widest(wide) - _widest(thin) for wide, thin in zip(columns, narrow, strict=True)
            ]
            if max(savings, default=0) <= 0:
                break
            widest = savings.index(max(savings))
            columns[widest] = narrow[widest]
        return [*names, *columns]

    def _column(self, i: int, narrow: bool = False, name: int = 0) -> "list[Text]":
        """Return the heading and the cells of a column, those of a name broken beyond its width.

        If `narrow`, the lines below its numbers are broken, an interval after its dash.
        """
        from rich.text import Text

        cells = [as_cell(row[i]) for row in self.rows]
        pad = " " if any(cell.strong for cell in cells) else ""  # below the stars
        texts = []
        for cell in cells:
            text = folded(cell.text, name) if name else cell.text
            styled = Text(text + pad, cell.colour)
            if cell.strong:
                styled = Text(f"{text}*", f"bold {cell.colour}".strip())
            below = folded(cell.below, name) if name else cell.below
            below = _narrow(cell.below) if narrow else below
            for lines, style in ((below, "dim not bold"), (cell.alarm, "red not bold")):
                for line in lines.splitlines():
                    styled.append(f"\n{line}{pad}", style)
            texts.append(styled)
        lines = self._heading(i, max(map(_width, texts), default=0))
        return [Text("\n".join(line and f"{line}{pad}" for line in lines)), *texts]

    def _heading(self, i: int, width: int) -> list[str]:
        """Return a heading on lines as wide as the cells of its column, and its unit, or ""."""
        name, _, unit = self.headings[i].replace("^2", "²").partition(" (")
        unit = unit.removesuffix(")")
        least = max(HEADING_WIDTH, len(unit), width)
        return [*textwrap.wrap(name, least, break_long_words=False), unit]

    def _repr_html_(self) -> str:
        return self.as_html(MAX_HTML_ROWS)

    def as_html(self, most: int | None = None) -> str:
        """Return the table as HTML; of more rows than `most` only their number."""
        heads = [heading.replace("^2", "²") for heading in self.headings]
        rule = "font-weight:normal;border-bottom:1px solid currentColor;"
        lines = [self._html_row("th", heads, rule)] if any(heads) else []
        lines += [self._html_row("td", row) for row in self.rows[:most]]
        more = len(self.rows) - len(self.rows[:most])
        notes = [f"and {more} more"] if more else []
        for note in [*notes, *self.notes]:
            side = f'colspan="{len(self.headings)}" style="{HTML_CELL}left;opacity:0.75"'
            lines.append(f"<tr><td {side}><div>{html.text(note)}</div></td></tr>")
        caption = f'<caption style="{HTML_TITLE}">{html.strong(self.title)}</caption>'
        parts = [f'<table style="{HTML_TABLE}">', caption if self.title else "", *lines]
        return "".join([*parts, "</table>"])

    def _html_row(self, tag: str, cells: Sequence[Cell | str], style: str = "") -> str:
        """Return a row of HTML."""
        texts = []
        for i, cell in enumerate(cells):
            side = "left" if i < self.name_columns else "right"
            breaks = "white-space:nowrap;" if tag == "td" and side == "right" else ""
            texts.append(f'<{tag} style="{style}{breaks}{HTML_CELL}{side}">{_html(cell)}</{tag}>')
        return f"<tr>{''.join(texts)}</tr>"

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
            *head, unit = self._heading(i, math.ceil(widest / TEX_CHARACTER))
            head += [f"({unit})"] if unit else []
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


def plain_text(shown: "RenderableType", width: int = PLAIN_WIDTH) -> str:
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
    lines = []
    for line in name.splitlines():
        broken = textwrap.fill(line.replace("_", "_ "), width).replace("_ ", "_")
        lines.append(line if len(line) <= width else broken)
    return "\n".join(lines)


def of_fields(title: str, values: Mapping[str, object]) -> Tabular:
    """Return a table of names with their values."""
    rows = [(Cell(name, colour="cyan"), str(value)) for name, value in values.items()]
    return Tabular(headings=("", ""), rows=rows, title=title, name_columns=2)


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


def _narrow(text: str) -> str:
    """Return a text on narrow lines; a number stays with its unit."""
    parts = re.sub(r"(\d) ", rf"\1{NO_BREAK}", text.replace("–", "–\n")).splitlines()
    lines = [textwrap.fill(part, NARROW_WIDTH, break_long_words=False) for part in parts]
    return "\n".join(lines).replace(NO_BREAK, " ")


def _width(text: "Text") -> int:
    """Return the width of the longest line."""
    return max((line.cell_len for line in text.split("\n")), default=0)


def _widest(column: "Sequence[Text]") -> int:
    return max(map(_width, column))


def _total(columns: "Sequence[Sequence[Text]]") -> int:
    """Return the width of columns beside each other."""
    return sum(map(_widest, columns)) + GAP * (len(columns) - 1)


def _parts(widths: Sequence[int], width: int, names: int) -> list[list[int]]:
    """Return the columns of each part of a table that fits into a width; each part begins with the
    names.
    """
    parts = [list(range(names))]
    for i in range(names, len(widths)):
        wider = [*parts[-1], i]
        if len(wider) > names + 1 and sum(widths[k] + GAP for k in wider) - GAP > width:
            wider = [*range(names), i]
            parts.append(wider)
        parts[-1] = wider
    return parts


def _html(cell: Cell | str) -> str:
    """Return a cell as HTML, with the lines below in smaller letters."""
    cell = as_cell(cell)
    text = cell.text
    if not isinstance(text, html.Html):
        text = html.Html("<br>".join(map(html.text, text.split("\n"))))
    text = html.Html(f"{html.strong(text)}*") if cell.strong else text
    if below := "<br>".join(map(html.text, _below(cell))):
        return html.Html(f'{text}<br><small style="white-space:nowrap">{below}</small>')
    return text


def _below(cell: Cell | str) -> list[str]:
    """Return the lines below a cell's text."""
    cell = as_cell(cell)
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
