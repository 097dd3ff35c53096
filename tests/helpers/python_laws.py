"""Laws that stay in Python, of a function from what is seen to what is done."""

import copy

import numpy as np

import smc_mujoco as smc
from smc_mujoco.common.jit import Uncompiled


class Acting(Uncompiled):
    """u is a function's share of the bound on u, from (x, v); its object is copied for each run."""

    why = "is Python"

    def __init__(self, act):
        self.act = act
        self.__name__ = "acting"

    def __call__(self, y, gains, memory):
        return float(self.act(np.array([y.x, y.v]))[0]) * y.limit, 0.0

    def fresh(self):
        return Acting(copy.deepcopy(self.act))


def acting(act):
    """Return the law of such a function."""
    return smc.law_function(Acting(act))()
