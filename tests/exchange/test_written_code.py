"""A law in C is written as recorded: users read and compile it.

Other tests run it, in C and in FMUs.
"""

import re

import pytest

import smc_mujoco as smc
from smc_mujoco.exchange.c import build


@pytest.mark.quick
def test_a_law_in_c_is_as_recorded(snapshot):
    """Without its docstring, the header and the version."""
    text = smc.exchange.law_to_c("super_twisting", "float")
    text = text.replace(smc.__version__, "VERSION").replace(
        build.HEADER.read_text(encoding="utf-8").strip(), "HEADER"
    )
    assert (
        re.sub(r"( \*\n \* [^\n]*\n).*?(?= \* gains )", r"\1", text, count=1, flags=re.DOTALL)
        == snapshot
    )
