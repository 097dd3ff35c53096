"""Numbers and lists in words, and a table for every reader: terminal, plain text, notebook,
LaTeX.
"""

import math
import re

import pytest

from smc_mujoco.common import tabular
from smc_mujoco.common.tabular import Cell, Tabular
from smc_mujoco.common.text import in_one_notation, number, real

pytestmark = pytest.mark.quick

NUMBERS = {  # value -> with three digits, with one
    math.nan: ("none", "none"),
    -math.inf: ("never", "never"),
    0.0: ("0", "0"),
    -9.9e-10: ("<1e-9", "<1e-9"),
    1e-9: ("1.0e-9", "1e-9"),
    9.994e-4: ("1.0e-3", "1e-3"),
    1e-3: ("0.00100", "0.001"),
    -0.012345: ("-0.0123", "-0.01"),
    1.0: ("1.00", "1"),
    98.76: ("98.8", "99"),
    -12345.6: ("-12346", "-12346"),
    1e5: ("1.0e5", "1e5"),
    2.56e12: ("2.6e12", "3e12"),
}
LONG = "a_name_that_is_longer than_twenty"
TABLE = Tabular(
    title="Laws & gains",
    label="Laws & their gains",
    headings=["law", "gains", "ITAE (m s^2)", "bound (m)", "time until it rests (s)"],
    rows=[
        [
            Cell("pid", "given"),
            "kp=3_0",
            Cell("1.2e-4", "1.1–1.3", strong=True),
            "3 %",
            Cell("never", alarm="2 of 9 fail"),
        ],
        [
            Cell(LONG, "2 of 9 fail", colour="red"),
            "",
            Cell("2.5", "2.25–12.75"),
            Cell("−4 ± 1", "a\nb"),
            "λ₂ < x²",
        ],
    ],
    notes=["A note.", "Another."],
    under=["A word: 5 %.", "A paragraph after 10 ms."],
    name_columns=2,
)


@pytest.mark.parametrize("value", NUMBERS)
def test_a_number_has_as_many_digits_as_are_asked_for(value):
    assert (number(value), number(value, 1)) == NUMBERS[value]


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ([8.7e-4, 3.3e-5, 0.00207], ["8.7e-4", "3.3e-5", "2.1e-3"]),
        ([98765.0, -0.5, 1.2e5], ["9.9e4", "-5.0e-1", "1.2e5"]),
        ([3e-5, 0.0, 1e-10, math.inf, math.nan], ["3.0e-5", "0", "<1e-9", "never", "none"]),
        ([0.5, 1e-10, math.inf], ["0.500", "<1e-9", "never"]),
    ],
)
def test_numbers_that_stand_together_have_one_notation(values, texts):
    assert in_one_notation(values) == texts


@pytest.mark.parametrize("width", [80, 44])
def test_a_table_fits_into_a_width_with_all_its_words_marks_and_notes(width):
    text = tabular.plain_text(TABLE, width)
    rows = text.splitlines()
    assert max(map(len, rows)) <= width
    reported = re.sub(r"[\s─]", "", text)
    for word in (
        "Laws&gains",
        "law",
        "pid",
        "given",
        "1.2e-4",
        "3%",
        "never",
        "12.75",
        "Anote.",
        "Another.",
    ):
        assert word in reported
    heads = [k for k, line in enumerate(rows) if line.startswith("law")]
    units = rows[heads[0] + 1].split()
    assert units[:3] == ["m", "s²", "m"]
    assert rows[heads[0] + 2].startswith("pid")


def test_a_table_for_notebooks_and_for_latex_has_all_its_words(snapshot):
    cells = re.findall(r"<td[^>]*>(.*?)</td>", TABLE._repr_html_())
    assert len(cells) >= 10
    assert "λ₂ &lt; x²" in cells
    assert any("2 of 9 fail" in cell for cell in cells)
    assert any("<b>1.2e-4</b>" in cell for cell in cells)
    assert TABLE.to_latex() == snapshot(name="latex")
    long = Tabular(headings=["a"], rows=[["b"]] * 100)
    assert long._repr_html_().count("<tr>") == 1 + 99 + 1
    assert "and 1 more" in long._repr_html_()
    assert "addlinespace" not in long.to_latex()


@pytest.mark.parametrize("number", ["4.9", "<1", "-3"])
def test_a_number_with_an_exponent_is_one_formula(number):
    assert tabular.tex(f"k={number}e-8, 2e5") == rf"k=${number}\cdot10^{{-8}}$, $2\cdot10^{{5}}$"


@pytest.mark.parametrize(
    ("interval", "written"),
    [
        ("3.2e-9–8.1e-7", r"(0.032--8.1)$\cdot10^{-7}$"),
        ("1.9e5–5.2e5", r"(1.9--5.2)$\cdot10^{5}$"),
        ("3.2e-9–8.1e-6", r"($<$0.01--8.1)$\cdot10^{-6}$"),
        ("<1e-9–2.0e-9", r"($<$1--2.0)$\cdot10^{-9}$"),
        ("<1e-9–0.00223", "$<$0.00001--0.00223"),
    ],
)
def test_the_ends_of_an_interval_share_a_power_if_theirs_are_near(interval, written):
    assert tabular.tex(interval) == written


def test_a_letter_beside_a_number_with_a_power_is_no_exponent():
    cell = Cell("4.9e-8", "below 5e-5 rad", strong=True)
    latex = Tabular(headings=["law", "bound"], rows=[["pid", cell]]).to_latex()
    assert "\npid & \\textbf{\\boldmath$4.9\\cdot10^{-8}$}~{\\footnotesize (a)} \\\\\n" in latex
    assert r"\raggedright (a):~below~$5\cdot10^{-5}$~rad} \\" in latex


def test_latex_breaks_words_at_the_width_of_the_columns():
    def width(columns: int) -> float:
        """Return the width of the words, em."""
        row = ["pid", *[Cell("1.23", "below 2.5 rad")] * columns]
        latex = Tabular(headings=["law"] * len(row), rows=[row], under=["word " * 99]).to_latex()
        assert latex.count("word") == 99
        said = re.findall(
            r"\n\\multicolumn\{(\d+)\}\{p\{\\dimexpr (.*?)em\+(\d+)\\tabcolsep", latex
        )
        assert len(said) == 2
        (cells, em, gaps) = said[1]
        assert (int(cells), int(gaps)) == (columns + 1, 2 * columns)
        return float(em)

    assert width(1) == tabular.TEX_WIDTH  # a column of a paper
    assert width(11) - width(10) == pytest.approx(len("1.23 (a)") * tabular.TEX_CHARACTER)


def test_names_too_wide_for_a_line_are_broken_after_underscores():
    """Seven columns of names are 83 characters wide."""
    row = ["inverted_pendulum", "super_twisting", "tuned here", "12", "1045", "7 %", "k1=2, k2=13"]
    headings = ["plant", "law", "gains", "searches", "evaluations", "J spread", "best set"]
    lines = str(Tabular(headings=headings, rows=[row], name_columns=7)).splitlines()
    assert max(map(len, lines)) <= tabular.PLAIN_WIDTH
    assert [line.split()[:2] for line in lines[-2:]] == [
        ["inverted_", "super_"],
        ["pendulum", "twisting"],
    ]


def test_u_max_is_a_formula_and_a_law_of_that_name_is_not():
    assert tabular.tex("u_max, my_u_max") == r"$u_{\max}$, my\_u\_max"


def test_every_character_that_latex_reads_is_written_out():
    assert tabular.tex("a\N{NO-BREAK SPACE}^-12 ⁰₉ \\~^&%$#_{}<|>Ωε–·×±−′″") == (
        r"a~$^{-12}$ $^0$$_9$ \textbackslash{}\textasciitilde{}\textasciicircum{}"
        r"\&\%\$\#\_\{\}$<$$|$$>$$\Omega$"
        r"$\varepsilon$--$\cdot$$\times$$\pm$$-$$'$$''$"
    )


@pytest.mark.parametrize("text", ["３", "0.３", "1_0", "٣", "x", ""])
def test_a_number_is_in_the_digits_0_to_9(text):
    with pytest.raises(ValueError, match=f"(^|'){text}"):
        real(text)
    assert real(" -1.5e-3 ") == -1.5e-3
