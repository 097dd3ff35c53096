"""Runs a second of the fast engine: on the processor, beside MuJoCo, and on a CUDA device.

    python benchmarks/engine.py
    python benchmarks/engine.py --cuda   # on a device, or "no device": make gpu
    python benchmarks/engine.py --picture region.png   # 1,000 x 1,000 starts; also with --cuda

Each case is one law on one plant for 10 s, with noise: runs differ in their starts and seeds. The
device's scores are compared with the processor's on 1,000 runs, and the processor's with MuJoCo's
on 20. Ratios are of times in one run of this script.
"""

import sys
import time
from collections.abc import Callable

import numpy as np

import smc_mujoco as smc
from smc_mujoco.analysis.engine.form import FAILURE, SCORES, SETTING
from smc_mujoco.analysis.engine.group import FormGroup
from smc_mujoco.metrics import catalogue
from smc_mujoco.robustness import region_figure
from smc_mujoco.simulation.run import cores

METRICS = ("settling_time", "itae", "tv_rate")
LAW = smc.law("super_twisting", k1=8.0, k2=10.0, c=3.0)
NOISE = smc.Noise(1e-3, 5e-3)
CASES = {  # and how many runs a second an H100 should make
    "pendulum": (1_000_000, {"plant": "inverted_pendulum"}),
    "five pendulums": (300_000, {"plant": "inverted_pendulum_network"}),
    "delay, Levant's estimator, a sine": (
        200_000,
        {
            "plant": "inverted_pendulum",
            "input_delay": 3e-3,
            "velocity": "levant",
            "disturbance": smc.Sine(0.2, 5.0),
        },
    ),
}
COMPARED = 1000
AT_ONCE = 2**20  # on the device
BY_MUJOCO = 20
DURATION = 10.0


def scenario(fields: dict, seed: int = 0) -> smc.Scenario:
    return smc.Scenario(law=LAW, noise=NOISE, duration=DURATION, u_max=6.0, seed=seed, **fields)


def rows_of(group: FormGroup, count: int) -> np.ndarray:
    """Rows of runs that differ in seed and start."""
    rows = np.repeat(group.rows[:1], count, axis=0)
    places = group.layout.row
    n = group.form.n
    starts = np.random.default_rng(1).uniform(0.2, 0.6, (count, n))
    rows[:, places.x0 : places.x0 + n] = starts
    rows[:, places.bands : places.bands + n] = 0.02 * starts.max(axis=1, keepdims=True)
    rows[:, SETTING.seed] = np.arange(count)
    return rows


def rate(run: Callable[[], object], count: int) -> float:
    """Runs a second."""
    began = time.perf_counter()
    run()
    return count / (time.perf_counter() - began)


def apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Relative differences of scores, of each run the largest, ascending; inf equals inf."""
    alike = (one == other) | (np.isnan(one) & np.isnan(other))
    with np.errstate(invalid="ignore"):
        differences = np.abs(one - other) / np.maximum(np.abs(other), 1e-12)
    return np.sort(np.where(alike, 0.0, differences)[:, SCORES:].max(axis=1))


def on_processor(fields: dict) -> str:
    """Runs a second in all threads, how they scale, MuJoCo's, and how far apart the scores are."""
    group = FormGroup([scenario(fields, seed) for seed in range(BY_MUJOCO)], METRICS)
    rows = rows_of(group, COMPARED)
    engine_scores = group.run(group.rows)
    in_one = rate(lambda: group.run(rows, threads=1), COMPARED)
    in_all = rate(lambda: group.run(rows), COMPARED)
    traces = []
    by_mujoco = rate(lambda: traces.extend(smc.run(group.scenarios)), BY_MUJOCO)
    expected = engine_scores.copy()
    for row, trace in zip(expected, traces, strict=True):
        row[SCORES:] = [getattr(catalogue, metric)(trace) for metric in METRICS]
    return (
        f"{in_all:9,.0f}  {in_all / in_one:5.2f}x  {by_mujoco:8,.0f}  {in_all / by_mujoco:5.1f}x  "
        f"{apart(engine_scores, expected)[-1]:.0e}"
    )


def on_device(fields: dict, wanted: int) -> str:
    """Runs a second on the device, beside the processor, and how far apart the scores are."""
    group = FormGroup([scenario(fields)], METRICS)
    few = rows_of(group, COMPARED)
    many = rows_of(group, AT_ONCE)
    device_scores = group.run(few, device="cuda")
    expected = group.run(few)
    by_processor = rate(lambda: group.run(few), COMPARED)
    by_device = rate(lambda: group.run(many, device="cuda"), AT_ONCE)
    alike = (device_scores[:, FAILURE] == expected[:, FAILURE]).mean()
    differences = apart(device_scores, expected)
    return (
        f"{by_processor:9,.0f}  {by_device:11,.0f}  {wanted:9,}  {by_device / by_processor:5.0f}x  "
        f"{100 * alike:5.1f} %  {differences[COMPARED // 2]:.0e}  {differences[-1]:.0e}"
    )


def picture(path: str, device: str, side: int = 1000) -> None:
    """Draw from where a weak law brings the pendulum upright, a start a pixel."""
    law = smc.law("observer_free", lam=1.5, k1=9.0)  # N m, of the 2.45 that hold it anywhere
    began = time.perf_counter()
    basin = smc.design.basin("inverted_pendulum", law, points=(side, side), device=device)
    seconds = time.perf_counter() - began
    region_figure.draw_regions([basin], path)
    share = 100.0 * basin.share
    print(f"{path}: {share:.3f} % of {side**2:,} starts in {seconds:.1f} s; {basin.checked}")


def main() -> None:
    cuda = "--cuda" in sys.argv
    if cuda and not has_device():
        return
    if "--picture" in sys.argv:
        path = sys.argv[sys.argv.index("--picture") + 1]
        picture(path, "cuda" if cuda else "cpu")
        return
    print(f"{cores(None)} threads; runs of {DURATION:g} s a second")
    if cuda:
        print("case, threads, device, wanted, ratio; fail alike, scores apart: median, largest")
    else:
        print("case, threads, to one thread, MuJoCo, ratio; scores apart")
    for name, (names, fields) in CASES.items():
        cells = on_device(fields, names) if cuda else on_processor(fields)
        print(f"{name:34}{cells}", flush=True)


def has_device() -> bool:
    """Print the name of the CUDA device, or why there is none, and return whether there is one."""
    try:
        from smc_mujoco.analysis.engine import gpu

        gpu.check_device()
    except smc.ScenarioError as error:
        print(f"no device: {error}")
        return False
    name = gpu.cuda.get_current_device().name
    print(name.decode() if isinstance(name, bytes) else name)
    return True


if __name__ == "__main__":
    main()
