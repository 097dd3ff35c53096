"""Tables for notebooks: well-formed, escaped, without colours, and short."""

from xml.etree import ElementTree

import pytest

from smc_mujoco.common import html
from smc_mujoco.common.tabular import Tabular, of_fields

pytestmark = pytest.mark.quick

EVIL = '<script>alert("x")</script> & "y"'


def parsed(text: str) -> ElementTree.Element:
    """HTML that is also well-formed XML."""
    return ElementTree.fromstring(f"<div>{text}</div>")


def test_text_is_escaped_everywhere():
    table = Tabular(headings=(EVIL, "b"), rows=[(EVIL, "1")], title=EVIL, notes=[EVIL])
    page = table._repr_html_() + of_fields(EVIL, {EVIL: EVIL})._repr_html_()
    assert "<script>" not in page
    cells = []
    for node in parsed(page).iter():
        if node.text and "script" in node.text:
            cells.append(node.text)
    assert cells == [EVIL] * 7  # 4 of the table, 3 of the fields
    assert html.text(html.strong(EVIL)) == html.strong(EVIL)
