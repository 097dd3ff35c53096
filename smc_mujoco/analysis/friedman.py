"""Would the order of the laws hold in other conditions? M. Friedman's test over the blocks of a comparison."""

import dataclasses
import functools
import math

from smc_mujoco.analysis.ranking import Comparison, block_ranks


@dataclasses.dataclass(frozen=True, kw_only=True)
class Friedman:
    """M. Friedman's test that laws rank alike, with P. Nemenyi's critical difference (J. Demsar, JMLR 7(1), 2006).

    Here the blocks are the sample, not the seeds: would the order hold in other conditions? Demsar trusts the chi^2
    distribution from about ten blocks on.

    Attributes:
      blocks: how many.
      mean_ranks: law -> mean rank over the blocks, in each by its median over the seeds.
      p: that laws which rank alike differ by so much.
      critical_difference: of mean ranks; laws that differ by less are not told apart.
    """

    blocks: int
    mean_ranks: dict[str, float]
    p: float
    critical_difference: float


def friedman(found: Comparison) -> Friedman | None:
    """Run Friedman's test over the blocks, corrected for ties; None for one law or one block."""
    from scipy.special import chdtrc

    k, blocks = found.centres.shape
    if k < 2 or blocks < 2:
        return None
    place = block_ranks(found.centres, found.floors)
    spread = float(((place - (k + 1) / 2) ** 2).sum())
    between = float(((place.sum(axis=1) - blocks * (k + 1) / 2) ** 2).sum())
    return Friedman(
        blocks=blocks,
        mean_ranks=dict(zip(found.laws, place.mean(axis=1).tolist(), strict=True)),
        p=float(chdtrc(k - 1, (k - 1) * between / spread)) if spread else 1.0,
        critical_difference=_studentised(k, found.level) * math.sqrt(k * (k + 1) / (12 * blocks)),
    )


@functools.cache
def _studentised(k: int, level: float) -> float:
    """Return the quantile of the studentised range of k normal means; Demsar's q is 1 / sqrt(2) of it."""
    from scipy.stats import studentized_range

    return float(studentized_range.ppf(level, k, math.inf))
