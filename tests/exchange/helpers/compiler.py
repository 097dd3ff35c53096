"""The mark of tests that compile C."""

import shutil

import pytest

from smc_mujoco.exchange.c import build

needs_compiler = pytest.mark.skipif(
    shutil.which(build.compiler()[0]) is None, reason="there is no C compiler here"
)
