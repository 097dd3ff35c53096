"""What an elastic joint, and an encoder on its motor, do to the order of laws.

    python benchmarks/elastic.py

The pendulum of the study under a sine, rigid, with condition `elastic`, and with `motor_side`, by
laws with their shipped gains, which no search has fitted to a spring. The script prints the table
of docs/mechanisms.md: the largest error of the last fifth of a run of 10 s, mrad. It takes some ten
seconds of processor time.
"""

from smc_mujoco.metrics.catalogue import score
from smc_mujoco.simulation.grid import grid
from smc_mujoco.simulation.run import run

PLANT = "inverted_pendulum"
LAWS = ("super_twisting", "twisting", "adrc", "pid", "observer_free", "boundary_layer")
CONDITIONS = {
    "rigid": "sine",
    "elastic": "sine + elastic",
    "encoder on the motor": "sine + motor_side",
}


def bounds(laws: tuple[str, ...] = LAWS) -> dict[str, list[float]]:
    """Return law -> its ultimate bound in each condition, mrad."""
    found: dict[str, list[float]] = {law: [] for law in laws}
    for condition in CONDITIONS.values():
        for trace in run(grid(PLANT, list(laws), condition, seeds=1)):
            found[trace.scenario.law.name].append(1e3 * score(trace)["ultimate_bound"])
    return found


def table() -> str:
    """Return the table of docs/mechanisms.md; the least of each column is bold."""
    found = bounds()
    least = [min(column) for column in zip(*found.values(), strict=True)]
    lines = [f"| law | {' | '.join(CONDITIONS)} |", "|---" * (1 + len(CONDITIONS)) + "|"]
    for law, values in found.items():
        cells = []
        for value, best in zip(values, least, strict=True):
            text = f"{value:.2g}"
            cells.append(f"**{text}**" if value == best else text)
        lines.append(f"| `{law}` | {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(table())
