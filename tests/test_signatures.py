"""A public function or class takes what is recorded, in this order, with these defaults."""

import inspect
import re

import pytest
from helpers.words import recorded

import smc_mujoco as smc

pytestmark = pytest.mark.quick

PUBLIC = {name: getattr(smc, name) for name in smc.__all__}
NAMES = [name for name, one in PUBLIC.items() if callable(one) and "Warning" not in name]


@pytest.mark.parametrize("name", recorded(__file__, NAMES))
def test_a_public_name_takes_what_is_recorded(name, snapshot):
    parameters = inspect.signature(PUBLIC[name]).parameters.values()
    said = ", ".join(str(one.replace(annotation=one.empty)) for one in parameters)
    assert re.sub(" at 0x[0-9a-f]+", "", said) == snapshot
