"""The gains of the sets "tuned" and "tracking", found again: smc_mujoco/control/tuned_gains.

    python benchmarks/gains.py              # what is missing
    python benchmarks/gains.py --all        # all of it, within 90 minutes on two cores

Every law by the same rule and budget; a tuning that is whole is kept, so that it may be stopped at any time.
"""

import argparse
from collections.abc import Iterator

import smc_mujoco as smc
from smc_mujoco.control import gain_sets as gains
from smc_mujoco.control.gain_sets import general
from smc_mujoco.evidence.papers.gaber.scenarios import PLANTS

BUDGET = 96


def tunings() -> Iterator[tuple[str, str, int]]:
    """Objective, law and seed of all tunings: every law, then those of the first page from their other seeds."""
    yield from (("balanced", law, 0) for law in general())
    for name, objective in gains.OBJECTIVES.items():
        first = 1 if name == "tuned" else 0
        yield from ((objective, law, seed) for seed in range(first, gains.SEEDS[name]) for law in gains.LAWS)


def main() -> None:
    """Tune what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--all", action="store_true", help="tune again what is there")
    again = parser.parse_args().all
    for objective, law, seed in tunings():
        for plant in PLANTS:
            path = gains.file(plant, law, objective, seed)
            if again or not path.exists():
                found = smc.tune(plant, law, BUDGET, seed, objective, progress=True)
                found.save(path)
                at = f", at its bound: {found.at_bound}" if found.at_bound else ""
                print(f"{objective} {seed}: {plant}, {found.law}: {found.objective:.4g} s²{at}", flush=True)


if __name__ == "__main__":
    main()
