"""What laws of many joints cost on a seven-joint arm, beside bare mj_step, and how well a batch of arms uses the cores.

    python benchmarks/arm.py [--quick]

Physics at 0.5 ms, control at 1 kHz. Only ratios within one run mean anything on a shared machine; each is the median
over rounds that alternate between the two sides. A law's cost is the mean of physics steps with the callback, of which
every second has a control sample, over that of steps without.
"""

import time

from speed import STEPS, chunk, ratio, stepping

import smc_mujoco as smc
from smc_mujoco.simulation.run import cores

ARMS, TARGET = 64, 1.5
LENGTHS = (0.333, 0.1, 0.316, 0.1, 0.384, 0.1, 0.107)  # m: those of a Franka Panda, roughly
MASSES = (3.0, 2.5, 3.0, 2.7, 3.0, 1.6, 0.7)  # kg, chosen
LAWS = ("observer_free_joint", "time_delay_sliding", "computed_torque_sliding", "passivity_based")


def arm() -> smc.Plant:
    """A seven-joint arm whose axes are across its links and along them in turn."""
    text = ""
    for i, (length, mass) in reversed(list(enumerate(zip(LENGTHS, MASSES, strict=True)))):
        below = LENGTHS[i - 1] if i else 0.0
        text = f"""<body pos="0 0 {below}"><joint name="q{i}" axis="{"0 0 1" if i % 2 == 0 else "0 1 0"}" damping="0.5"
            armature="0.1"/><geom type="capsule" size="0.05" fromto="0 0 0 0 0 {length}" mass="{mass}"/>{text}</body>"""
    motors = "".join(f'<motor joint="q{i}" ctrlrange="-87 87"/>' for i in range(7))
    flags = '<default><geom contype="0" conaffinity="0"/></default>'
    model = f"<mujoco>{flags}<worldbody>{text}</worldbody><actuator>{motors}</actuator></mujoco>"
    channels = {f"q{i}": smc.Channel(x0=0.3 - 0.1 * i) for i in range(7)}
    return smc.plant_from(model, channels=channels, name="seven_joints")


def main() -> None:
    """Print the costs of laws, and the use of cores."""
    plant = arm()
    for integrator in ("implicitfast", "RK4"):
        common = {"plant": plant, "physics_step": 5e-4, "integrator": integrator, "reference": smc.Sine(0.3, 2.0)}
        for law in LAWS:
            scenario = smc.Scenario(law=law, duration=STEPS * 5e-4 + 1.0, **common)
            batch = chunk(scenario, 1, 1)
            with_law, bare, factor = ratio(stepping(batch, STEPS, False), stepping(batch, STEPS, True))
            microseconds = f"{1e6 * with_law / STEPS:6.2f} us a step, {1e6 * bare / STEPS:6.2f} bare"
            print(f"{integrator:13} {law:26} {microseconds}: {factor:.2f} (at most {TARGET})", flush=True)
    scenario = smc.Scenario(plant=plant, law="computed_torque_sliding", physics_step=5e-4, duration=STEPS * 5e-4)
    steps = STEPS // 20
    alone, all_cores = (stepping(chunk(scenario, ARMS, threads), steps, False) for threads in (1, cores()))
    _, _, speed_up = ratio(alone, all_cores, time.perf_counter)
    print(f"{ARMS} arms on {cores()} cores: {speed_up:.2f} times as fast as on one")


if __name__ == "__main__":
    main()
