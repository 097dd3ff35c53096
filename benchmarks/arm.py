"""What laws of many joints cost on the Panda, beside bare mj_step, and how well a batch of arms
uses the cores.

    python benchmarks/arm.py [--quick]

Physics at 0.5 ms, control at 1 kHz. Only ratios within one run mean anything on a shared machine;
each is the median over rounds that alternate between the two sides. A law's cost is the mean of
physics steps with the callback, of which every second has a control sample, over that of steps
without. The arm has no weight: without a law it would fall to its stops, and what they cost would
make the law look cheap.
"""

import time

from speed import BARE, STEPS, batch_of, plain_steps, ratio, stepping

import smc_mujoco as smc
from smc_mujoco.simulation.run import cores

ARMS = 64
TARGET = 1.5
LAWS = ("observer_free_joint", "time_delay_sliding", "computed_torque_sliding", "passivity_based")


def main() -> None:
    """Print the costs of laws, and the use of cores."""
    arm = smc.plant("panda", grav=0.0)
    move = [smc.signals.Waypoints((0.0, 3.0), pair) for pair in zip(arm.x0, arm.rest, strict=True)]
    machine = {"plant": arm, "physics_step": 5e-4, "reference": move}
    for integrator in ("implicitfast", "RK4"):
        for law in LAWS:
            scenario = smc.Scenario(
                law=law, duration=STEPS * 5e-4 + 1.0, integrator=integrator, **machine
            )
            batch = batch_of(scenario, 1, 1)
            # both before the first step
            with_law, bare = stepping(batch, STEPS), stepping(batch, STEPS, BARE)
            law_seconds, bare_seconds, factor = ratio(with_law, bare)
            _, _, of_plain = ratio(with_law, plain_steps(scenario, 1, STEPS))
            microseconds = (
                f"{1e6 * law_seconds / STEPS:6.2f} us a step, "
                f"{1e6 * bare_seconds / STEPS:6.2f} bare"
            )
            factors = f"{factor:.2f}, {of_plain:.2f} of mj_step with its timers"
            print(
                f"{integrator:13} {law:26} {microseconds}: {factors} (at most {TARGET})", flush=True
            )
    scenario = smc.Scenario(law="computed_torque_sliding", duration=STEPS * 5e-4, **machine)
    steps = STEPS // 20
    alone, all_cores = (
        stepping(batch_of(scenario, ARMS, threads), steps) for threads in (1, cores())
    )
    _, _, speed_up = ratio(alone, all_cores, time.perf_counter)
    print(f"{ARMS} arms on {cores()} cores: {speed_up:.2f} times as fast as on one")


if __name__ == "__main__":
    main()
