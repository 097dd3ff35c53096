"""What pages of laws are made of: the parts of a docstring."""

import pytest

from smc_mujoco.control.docstring import entry
from smc_mujoco.control.law import law_function

pytestmark = pytest.mark.quick

PARTS = {  # docstring -> title, formula, what the gains are, discretisation, what is known, source
    "Plain: u = -k s. It is odd. Sampled, s is O(dt).\n\nIt holds for a. b too.\n\nSources: A. Body, 1. B. Other, 2.": (
        "Plain",
        "u = -k s",
        "",
        "Sampled, s is O(dt).",
        "It is odd. It holds for a. b too.",
        "A. Body, 1. B. Other, 2.",
    ),
    "Split, by:\n\n    u = -k s,\n    w' = e\n\nS. Gutman proved it. |u| <= k. `Explicit` it is.\nGains: k, explicit "
    "[N]; c, slope [1/s].\nSource: a page.": (
        "Split, by",
        "u = -k s, w' = e",
        "k, explicit [N]; c, slope [1/s].",
        "`Explicit` it is.",
        "S. Gutman proved it. |u| <= k.",
        "a page.",
    ),
    "Only words": ("", "Only words", "", "", "", ""),
}


@pytest.mark.parametrize("text", PARTS)
def test_a_docstring_has_a_title_a_formula_gains_sentences_on_sampling_others_and_a_source(text):
    def law(y, gains, memory):
        return 0.0, 0.0

    law.__doc__ = text
    assert tuple(entry(law_function(law))) == PARTS[text]
