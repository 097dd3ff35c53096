"""Tables for notebooks: well-formed, escaped, without colours, and short."""

from xml.etree import ElementTree

import pytest

from smc_mujoco.common import html

pytestmark = pytest.mark.quick

EVIL = '<script>alert("x")</script> & "y"'


def parsed(text: str) -> ElementTree.Element:
    """HTML that is also well-formed XML."""
    return ElementTree.fromstring(f"<div>{text}</div>")


def test_text_is_escaped_everywhere():
    pages = html.table((EVIL, "b"), [(EVIL, 1)], caption=EVIL, note=EVIL) + html.fields(
        {EVIL: EVIL}, EVIL
    )
    assert "<script>" not in pages
    cells = []
    for node in parsed(pages).iter():
        if node.text and "script" in node.text:
            cells.append(node.text)
    assert cells == [EVIL] * 7  # 4 of the table, 3 of the fields
    assert html.text(html.strong(EVIL)) == html.strong(EVIL)


def test_a_long_table_says_how_many_lines_it_leaves_out():
    rows = [(i, i) for i in range(20)]
    assert len(parsed(html.table(("a", "b"), rows)).findall(".//tbody/tr")) == html.MAX_ROWS + 1
    assert "and 8 more" in html.table(("a", "b"), rows)
    assert "more" not in html.table(("a", "b"), rows[: html.MAX_ROWS])
