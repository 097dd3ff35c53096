"""What many short runs in one call leave in memory, beside their traces and with them.

    python benchmarks/memory.py [RUNS]         100,000 of 20 ms unless told otherwise

The peak of a run whose traces are taken one by one, as `smc.stream` gives them, must stay below 1.5
GB.
"""

import resource
import sys
import time

import smc_mujoco as smc

LIMIT = 1500  # MB


def peak() -> float:
    """The most memory that this process has held, MB."""
    return (
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        * (1 if sys.platform == "darwin" else 1024)
        / 1e6
    )


def main() -> None:
    """Run, and say what it took."""
    if len(sys.argv) > 1:
        count = int(sys.argv[1])
    else:
        count = 100_000
    base = smc.Scenario(plant="duffing", law="super_twisting", duration=0.02)
    smc.run(base)
    many = []
    for seed in range(count):
        many.append(smc.Scenario(plant="duffing", law="super_twisting", duration=0.02, seed=seed))
    held = peak()
    start = time.perf_counter()
    failed = sum(trace.failure is not None for _, trace in smc.stream(many))
    spent = time.perf_counter() - start
    most = peak()
    print(f"{count} runs of 20 ms in {spent:.0f} s, {failed} failed")
    print(
        f"{held:.0f} MB before, {most:.0f} MB at most, limit {LIMIT} MB: "
        f"{'kept' if most < LIMIT else 'NOT KEPT'}"
    )


if __name__ == "__main__":
    main()
