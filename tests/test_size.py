"""The counter that `make size` prints from. No size is asked for: it is printed, not tested."""

import pytest
import size

pytestmark = pytest.mark.quick


def test_the_counter_by_hand():
    text = '''"""A docstring."""
# a comment
def f(x):
    """Another."""
    return [y for y in (2,)]
'''
    assert size.count(text) == {"tokens": 17, "lines": 2}
    assert size.comprehensions(text) == 1
    assert size.functions(text) == {"f": 3}
