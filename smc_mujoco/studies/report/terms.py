"""The definitions that a report's numbers link to, beside those of the metrics, which are their docstrings."""

from collections.abc import Sequence
from typing import NamedTuple

from smc_mujoco.analysis.differences import OF_SCALE, OF_VALUE
from smc_mujoco.analysis.ranking import SEEDS
from smc_mujoco.metrics.catalogue import metrics
from smc_mujoco.studies.report import words


class Term(NamedTuple):
    """A definition: its anchor, what it is called, and what it is."""

    id: str
    name: str
    text: str


class Metric(NamedTuple):
    """A metric's name, and its docstring in paragraphs."""

    name: str
    parts: tuple[str, ...]


STATISTICS = (
    Term(
        "cell",
        "cell",
        "One plant in one condition: every law runs in it with the same seeds.",
    ),
    Term(
        "median",
        "median",
        "Of the runs of a cell over its seeds. Seed 0 starts at the plant’s own x0, seed s at x0 (1 + 0.2 z), z "
        "uniform in [-1, 1]; where there is noise, the seed is the noise’s too. A run that fails counts as never. "
        "Seeds in which every law does the same are one run.",
    ),
    Term(
        "interval",
        "95 % interval",
        "Of the median, by bootstrap over the seeds: expanded percentiles of the medians of 1999 resamples, with "
        "whole seeds drawn again. Its ends are values of runs.",
    ),
    Term(
        "best",
        "better, winner",
        "A law is better than another in a cell if three things hold: its median is lower by more than the least "
        f"relevant difference ({100 * OF_VALUE:g} % of the larger; for a position {100 * OF_SCALE:g} % of the largest "
        f"|x0| and half a count of the encoder, for a command {100 * OF_SCALE:g} % of the bound on u, for a percentage "
        f"{100 * OF_SCALE:g}, where that is more); the sign test over the seeds rejects that both are ahead equally "
        f"often; there are {SEEDS} distinct runs or more. The tests are corrected by Holm’s method for all pairs of "
        "laws in all conditions of a plant, metric by metric: with 95 %, none of these is wrong. A law that is better "
        "than every other, directly or through a third, is the winner of the cell, and has its lowest median. Over "
        "several cells only what holds in each is called a win.",
    ),
    Term(
        "rank",
        "rank, place",
        "In each cell the law with the lowest median has rank 1, and so on; laws whose medians differ by less than the "
        "least relevant difference share the mean of their ranks. Mean rank is over all cells; the place orders the "
        "laws by it, with a 95 % interval by bootstrap over the seeds. Ranks count how often a law is ahead, not by "
        "how much, and decide nothing; every plant and condition of the grid weighs the same.",
    ),
    Term(
        "settles",
        "settles",
        "The share of runs with a finite settling time.",
    ),
    Term(
        "never",
        "never",
        "A run that does not get there before it ends, or that fails.",
    ),
    Term(
        "ratio",
        "times",
        "The law’s median over that of the best law, or over 1e-9 in SI units where that is less, which is told by "
        "“>”; less is better in every metric here.",
    ),
    Term(
        "verdict",
        "verdict",
        "A claim consists of sentences, each with checks. Under one set of gains it is supported where every sentence "
        "holds, refuted where none does, partly supported between. Over the sets: what they share, else partly "
        "supported, and marked as depending on the gains; one counter-example refutes a universal claim. Thresholds "
        "were fixed before any run.",
    ),
    Term(
        "lyapunov",
        "where V rises",
        "The points of a grid on the state plane at which V′ = s s′ > 0 and |s| > 1e-6, u neither saturated nor "
        "sampled, with the plant’s exact f and g; their share in percent. The plane is that of one joint, the others "
        "of a network in the same state: |x| up to twice the largest |x0|, |x′| up to k1 times that.",
    ),
    Term(
        "tracking",
        "tracking",
        "The first term of the objective of tuning: ITAE over the sum of |x0|, in s², summed over the runs of "
        "tuning: one in each of its seven conditions.",
    ),
    Term(
        "variation",
        "variation",
        "The second: total variation of u over u_max and the duration, in 1/s, summed over the same runs.",
    ),
    Term(
        "margin",
        "margin",
        "The largest level below the first that is not borne. A run bears a level if it does not fail and its "
        "ultimate bound is at most 5 % of its scale. The search looks at some ten levels from small to large, then"
        " halves what is left. What is above the first level not borne was not looked at, nor what is above the "
        "end of the search. None: the run without any of it does not stay within the 5 % either.",
    ),
    Term(
        "theory",
        "linear theory",
        "The same of the plant and the law linearised at rest, where the law is smooth.",
    ),
    Term(
        "basin",
        "region map",
        "From each state of a grid one run of up to 10 s; the joints of a network all start alike. It converges if"
        " it is within 2 % of the grid’s reach in position and velocity in the last 20 %, does not if it is never "
        "there in them, fails, or stands still elsewhere; else it is undecided. Decided ones end early. A pendulum"
        " that rests a turn away has not converged. The share is that of the grid’s states.",
    ),
    Term(
        "decimated",
        "curves in few points",
        "Of each stretch of samples the least and the largest are kept, so that no extreme is lost. Where u "
        "chatters, the line is its mean over 1 % of the run and the band reaches from its least to its largest "
        "value in each window.",
    ),
)


def terms(kinds: Sequence[str]) -> list[Term]:
    """Every definition, those of the kinds of margin among them."""
    about = _about_margins()
    found = [Term(f"margin-{kind}", words.kind(kind), about.get(kind, "")) for kind in kinds]
    return [*STATISTICS, *found]


def _about_margins() -> dict[str, str]:
    return {
        "delay": "Input delay, s: the command reaches the plant so much later.",
        "disturbance": "A constant force on every joint, N m or N.",
        "friction": "Coulomb friction in every joint, N m or N.",
        "mass": "Factor on the mass of the true plant; the law’s gains stay.",
        "noise": "Standard deviation of the noise on the measured position, rad or m.",
    }


def definitions() -> list[Metric]:
    """Every metric with its docstring, in people's signs."""
    found = []
    for metric in metrics():
        parts = words.definition(metric.name).split("\n\n")
        found.append(Metric(metric.name, tuple(words.pretty(" ".join(part.split())) for part in parts)))
    return found
