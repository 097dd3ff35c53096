"""The gains of the sets "tuned" and "tracking", found anew: smc_mujoco/tuned_gains.

    python benchmarks/gains.py              # what is missing
    python benchmarks/gains.py --all        # all: 60 tunings, about 20 minutes on two cores

Every law by the same rule, budget and seed; a tuning that is whole is kept, so that it may be stopped at any time.
"""

import argparse
import itertools

import smc_mujoco as smc
from smc_mujoco import gains

BUDGET, SEED = 256, 0


def main() -> None:
    """Tune what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--all", action="store_true", help="tune again what is there")
    again = parser.parse_args().all
    for objective, law, plant in itertools.product(gains.OBJECTIVES.values(), gains.LAWS, smc.paper.PLANTS):
        path = gains.file(plant, law, objective)
        if again or not path.exists():
            found = smc.tune(plant, law, BUDGET, SEED, objective, progress=True)
            found.save(path)
            at = f", at its bound: {found.at_bound}" if found.at_bound else ""
            print(f"{objective}: {plant}, {found.law}: {found.objective:.4g} s², before {found.before:.4g}{at}")


if __name__ == "__main__":
    main()
