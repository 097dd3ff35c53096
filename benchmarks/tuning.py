"""What a tuning costs: README's comparison beside that of another checkout, in processor seconds.

    python benchmarks/tuning.py [CHECKOUT] [--rounds 3]

The first run of each side compiles and is left out; then rounds alternate between the two. Without
a checkout, the times of this one alone.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parents[1]
# Prints the processor seconds of all tunings, and of the whole comparison, with the import.
COMPARISON = """
import math, time
import smc_mujoco as smc
from smc_mujoco.analysis.tuning import search

@smc.law_function(gains={"lam": 6.0, "k1": 3.0})
def my_law(y, gains, memory):
    s = y.de + gains.k1 * y.e
    return -gains.lam * math.tanh(s), s

def timed(*given, tune=search.tune, **named):
    global spent
    start = time.process_time()
    made = tune(*given, **named)
    spent += time.process_time() - start
    return made

spent, search.tune = 0.0, timed
laws, plants = [my_law, "classical", "super_twisting"], ["inverted_pendulum", "duffing"]
smc.compare(laws, plants, ["friction", "encoder"], out=OUT, threads=1)
print(spent, time.process_time())
"""


def measured(checkout: Path) -> tuple[float, float]:
    """Return the processor seconds of the tunings and of everything, in a fresh process."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "my_law.py"
        file.write_text(COMPARISON.replace("OUT", repr(str(Path(folder) / "compared"))))
        environment = os.environ | {"PYTHONPATH": str(checkout)}
        command = [sys.executable, str(file)]
        done = subprocess.run(
            command, env=environment, cwd=folder, capture_output=True, text=True, check=True
        )
    tuning, whole = done.stdout.splitlines()[-1].split()
    return float(tuning), float(whole)


def main() -> None:
    """Measure, and print medians and ratios."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("checkout", nargs="?", type=Path, help="of another version")
    parser.add_argument("--rounds", type=int, default=3)
    asked = parser.parse_args()
    sides = [HERE, *([asked.checkout.resolve()] if asked.checkout else [])]
    for side in sides:
        measured(side)
    rounds = [[measured(side) for side in sides] for _ in range(asked.rounds)]
    for i, name in enumerate(("tuning", "all")):
        seconds = [statistics.median(one[k][i] for one in rounds) for k in range(len(sides))]
        if asked.checkout:
            ratios = [one[0][i] / one[1][i] for one in rounds]
        else:
            ratios = []
        if ratios:
            against = f", there {seconds[1]:.1f} s, ratio {statistics.median(ratios):.2f}"
        else:
            against = ""
        print(f"{name}: {seconds[0]:.1f} s here{against}", flush=True)


if __name__ == "__main__":
    main()
