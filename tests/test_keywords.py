"""`pytest -k NAME` imports only files that may hold the name."""

import pytest
from conftest import may_hold

pytestmark = pytest.mark.quick

FILE = "tests/simulation/test_clock.py def test_Late_samples(): ..."


@pytest.mark.parametrize(
    ("expression", "holds"),
    [
        ("late", True),
        ("clock", True),
        ("early", False),
        ("late and early", False),
        ("late or early", True),
        ("early or (clock and samples)", True),
        ("not early", True),
        ("late and not samples", True),
        ("late[1]", True),
        ("two words", True),
        ("", True),
    ],
)
def test_a_file_is_left_out_only_where_it_cannot_hold_the_name(expression, holds):
    """What is negated, and what is not made of words, leaves nothing out."""
    assert may_hold(expression, FILE) is holds
