"""Commands that the tendons of a plant cannot give, in one sentence. Here `trace` is a Trace, which
imports this module.
"""

from typing import Any

import numpy as np

from smc_mujoco.common.text import joined
from smc_mujoco.mechanisms.hardware.tendons import of_plant
from smc_mujoco.mechanisms.layout import channel_names, loaded

LEAST = 1e-6  # of the bound on a joint's force: less is not told; chosen


def unreached(trace: Any) -> str:
    """Return how often and by how much the tendons of a run lacked the force that was commanded,
    and which were at a bound then; "" if they had it.
    """
    s = trace.scenario
    tendons = of_plant(s.plant)
    if tendons is None:
        return ""
    tensions, lacking = tendons.shared(loaded(s.plant), trace.x, trace.applied)
    channels = list(tendons.driven)
    sizes = np.nan_to_num(np.abs(lacking))
    beyond = sizes > LEAST * np.array(s.limits)[channels]
    if not beyond.any():
        return ""
    samples = beyond.any(axis=1)
    k, worst = np.unravel_index(np.argmax(np.where(beyond, sizes, 0.0)), sizes.shape)
    i = channels[worst]
    low, high = tendons.ends
    causes = []
    for words, ends in (("pulled no less", low), ("pulled no more", high)):
        held = tensions[k] == ends
        names = [repr(c.name) for c, holds in zip(tendons.cables, held, strict=True) if holds]
        if names:
            causes.append(f"{joined(names)} can be {words}")
    return (
        f"the tendons of {s.plant.name} lack force in {100.0 * samples.mean():.0f} % of the "
        f"samples under {s.law.name}: {sizes[k, worst]:.3g} {s.plant.efforts[i]} of the "
        f"{abs(trace.applied[k, i]):.3g} that joint {channel_names(s.plant)[i]!r} is to get at "
        f"{trace.t[k]:.3g} s, as {' and '.join(causes)}"
    )
