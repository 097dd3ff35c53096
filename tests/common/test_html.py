"""Tables for notebooks: well-formed, escaped, without colours, and short."""

import re
from xml.etree import ElementTree

import pytest

from smc_mujoco.common import html

pytestmark = pytest.mark.quick

EVIL = '<script>alert("x")</script> & "y"'


def parsed(text: str) -> ElementTree.Element:
    """HTML that is also well-formed XML."""
    return ElementTree.fromstring(f"<div>{text}</div>")


def test_text_is_escaped_everywhere():
    made = html.table((EVIL, "b"), [(EVIL, 1)], caption=EVIL, note=EVIL) + html.fields(
        {EVIL: EVIL}, EVIL
    )
    assert "<script>" not in made
    cells = [node.text for node in parsed(made).iter() if node.text and "script" in node.text]
    assert cells == [EVIL] * 7  # 4 of the table, 3 of the fields
    assert html.text(html.strong(EVIL)) == html.strong(EVIL)


def test_a_long_table_says_how_many_lines_it_leaves_out():
    rows = [(i, i) for i in range(20)]
    assert len(parsed(html.table(("a", "b"), rows)).findall(".//tbody/tr")) == html.MAX_ROWS + 1
    assert "and 8 more" in html.table(("a", "b"), rows)
    assert "more" not in html.table(("a", "b"), rows[: html.MAX_ROWS])


def test_numbers_stand_at_the_right():
    root = parsed(html.table(("a", "b", "c"), [(1, 2, 3)], numbers=range(1, 2)))
    sides = []
    for cell in root.iter():
        if cell.tag == "td":
            sides.append(re.findall(r"text-align:(\w+)", cell.get("style", ""))[-1])
    assert sides == ["left", "right", "left"]


def test_there_are_no_colours_but_the_page_s():
    made = html.table(("a",), [("b",)], "c", "d")
    parsed(made)
    assert not re.search(r"#[0-9a-fA-F]{3,6}\b|rgb\(|background", made)


def test_a_film_and_a_picture_are_in_the_page_with_their_bytes_and_width():
    film = html.embedded(b"abc", "video/mp4", 12.6)
    picture = html.embedded(b"abc", "image/png")
    assert "data:video/mp4;base64,YWJj" in film
    assert "data:image/png;base64,YWJj" in picture
    assert "13" in film
    assert html.table((), []) == html.table((), [], max_rows=1)
