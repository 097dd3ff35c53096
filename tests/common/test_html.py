"""Tables and curves for notebooks: well-formed, escaped, without colours, and short."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from smc_mujoco.common import html

pytestmark = pytest.mark.quick

EVIL = '<script>alert("x")</script> & "y"'


def parsed(text: str) -> ElementTree.Element:
    """HTML that is also well-formed XML."""
    return ElementTree.fromstring(f"<div>{text}</div>")


def test_text_is_escaped_everywhere():
    made = html.table((EVIL, "b"), [(EVIL, 1)], caption=EVIL, note=EVIL) + html.fields({EVIL: EVIL}, EVIL, EVIL)
    made += html.panel(np.arange(3.0), [np.arange(3.0)], EVIL)
    assert "<script>" not in made
    cells = [node.text for node in parsed(made).iter() if node.text and "script" in node.text]
    assert cells == [EVIL] * 10  # 4 of the table, 4 of the fields, title and heading of the panel
    assert html.text(html.strong(EVIL)) == html.strong(EVIL)


def test_a_long_table_says_how_many_lines_it_leaves_out():
    rows = [(i, i) for i in range(20)]
    assert len(parsed(html.table(("a", "b"), rows)).findall(".//tbody/tr")) == html.MAX_ROWS + 1
    assert "and 8 more" in html.table(("a", "b"), rows)
    assert "more" not in html.table(("a", "b"), rows[: html.MAX_ROWS])


def test_numbers_stand_at_the_right():
    root = parsed(html.table(("a", "b", "c"), [(1, 2, 3)], numbers=range(1, 2)))
    sides = [re.findall(r"text-align:(\w+)", cell.get("style", ""))[-1] for cell in root.iter() if cell.tag == "td"]
    assert sides == ["left", "right", "left"]


def points(svg: str) -> list[np.ndarray]:
    lines = [node.get("points", "") for node in parsed(svg).iter() if node.tag.endswith("polyline")]
    return [np.array([pair.split(",") for pair in line.split()], float) for line in lines]


def test_a_panel_keeps_the_extremes_of_a_long_curve_and_stays_inside():
    t = np.linspace(0.0, 10.0, 50_001)
    y = np.sin(t)
    y[31_234] = 7.0
    y[17] = -3.0
    (curve,) = points(html.panel(t, [y], "x (m)"))
    assert 100 < len(curve) <= 2 * html.PIECES + 2
    left, right, top, bottom = html._MARGINS
    assert curve[:, 1].min() == top  # 7.0
    assert curve[:, 1].max() == html.HEIGHT - bottom  # -3.0
    assert curve[0, 0] == left
    assert curve[-1, 0] == html.WIDTH - right
    assert (np.diff(curve[:, 0]) >= 0.0).all()


def test_larger_values_stand_higher_and_the_reference_is_dashed():
    t = np.linspace(0.0, 1.0, 5)
    svg = html.panel(t, [t], "x", reference=1.0 - t)
    rising, falling = points(svg)
    assert rising[0, 1] > rising[-1, 1]
    assert falling[0, 1] < falling[-1, 1]
    assert svg.count("stroke-dasharray") == 1


def test_a_range_is_labelled_once_where_its_ends_read_alike():
    for y, labels in ((np.array([1.5, 1.4999]), ["1.5"]), (np.ones(2), ["1"]), (np.array([1.5, 1.4]), ["1.5", "1.4"])):
        words = [
            node.text for node in parsed(html.panel(np.arange(2.0), [y], "x")).iter() if node.tag.endswith("}text")
        ]
        assert words == ["x", *labels, "0", "1 s"]


def test_what_is_not_finite_is_left_out():
    t = np.arange(5.0)
    (curve,) = points(html.panel(t, [np.array([0.0, 1.0, np.nan, np.inf, 2.0])[[0, 1, 2, 2, 4]]], "x"))
    assert len(curve) == 3
    assert html.panel(t, [np.full(5, np.nan)], "x") == ""


@pytest.mark.parametrize(
    "made", [html.table(("a",), [("b",)], "c", "d"), html.panel(np.arange(3.0), [np.ones(3)], "x")]
)
def test_there_are_no_colours_but_the_page_s(made):
    parsed(made)
    assert not re.search(r"#[0-9a-fA-F]{3,6}\b|rgb\(|background", made)
    assert set(re.findall(r'(?:stroke|fill)="([^"]+)"', made)) <= {"none", "currentColor"}


def test_pages_are_as_recorded(snapshot):
    """Places and texts of a panel by hand: times 1 to 3 s, values -2 to 2 m, within the margins of 300 x 96 px."""
    t, y = np.array([1.0, 1.5, 3.0]), np.array([-2.0, 1.0, 2.0])
    made = {
        "panel": html.panel(t, [y, -0.5 * y], "x (m)", reference=np.array([0.0, np.nan, 1.0])),
        "table": html.table(("a", "b"), [(i, html.strong("<")) for i in range(14)], "c", "d", range(1, 2)),
        "fields": html.fields({"k": 3.0, "law": "pid"}, "of a law", "note"),
        "film": html.embedded(b"abc", "video/mp4", 12.6),
        "picture": html.embedded(b"abc", "image/png"),
    }
    for name, text in made.items():
        assert re.sub("><(?=tr|pol|pat|text|/tab|/svg)", ">\n<", text) == snapshot(name=name)
    left, right, top, bottom = html._MARGINS
    first, second, reference = points(made["panel"])
    width, height = html.WIDTH - left - right, html.HEIGHT - top - bottom
    np.testing.assert_allclose(first[:, 0], left + width * np.array([0.0, 0.25, 1.0]), atol=0.05)
    np.testing.assert_allclose(first[:, 1], top + height * np.array([1.0, 0.25, 0.0]), atol=0.05)
    np.testing.assert_allclose(second[:, 1], top + height * np.array([0.25, 0.625, 0.75]), atol=0.05)
    np.testing.assert_allclose(reference[:, 1], top + height * np.array([0.5, 0.25]), atol=0.05)


def test_a_constant_curve_is_at_the_top_of_a_range_of_its_own_size():
    for level in (0.0, -4.0):
        (curve,) = points(html.panel(np.arange(2.0), [np.full(2, level)], "x"))
        assert (curve[:, 1] == html._MARGINS[2]).all()
    assert html.panel(np.arange(1.0), [np.ones(1)], "x") == html.panel(np.arange(3.0), [], "x") == ""
    assert html.table((), []) == html.table((), [], max_rows=1)
