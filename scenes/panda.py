"""What do joint friction and a payload that the law does not know do to an arm that moves between
two poses?

The Panda goes from its home pose to its ready pose in 3 s. First no joint rubs, then all have the
friction that Gaz et al. identified, and at last the arm also holds 2 kg, of which no law knows.
Gains are chosen, larger for light joints.

Look for: the last joint, whose friction is far above the torque that moves it. Super-twisting
follows within 1 mrad whatever rubs or hangs there; the boundary layer lags by 12 mrad, and by more
with the payload.
"""

import smc_mujoco as smc

PANDA = smc.plant("panda")
THERE = [smc.signals.Waypoints((0.0, 3.0), pair) for pair in zip(PANDA.x0, PANDA.rest, strict=True)]
K = [30.0, 20.0, 30.0, 40.0, 60.0, 100.0, 200.0]  # rad/s^2
L = [100.0, 100.0, 100.0, 400.0, 400.0, 2e3, 2e3]  # rad/s^3
M = [0.02, 0.4, 0.02, 0.1, 0.015, 0.01, 0.003]  # kg m^2
LAWS = {
    "boundary layer": smc.law("computed_torque_sliding", k=K, c=10.0, width=0.4),
    "super-twisting": smc.law(
        "super_twisting_computed_torque",
        k1=[1.5 * limit**0.5 for limit in L],
        k2=[1.1 * limit for limit in L],
        c=10.0,
    ),
    "time delay": smc.law("time_delay_sliding", m=M, k=20.0, c=10.0, width=0.4),
}


def run(law, friction=None, **payload):
    return smc.Scenario(
        plant=PANDA, law=law, reference=THERE, friction=friction, mismatch=payload, duration=4.0
    )


def error(trace):
    return 1e3 * abs(trace.x - trace.r).max()


def answer(runs):
    said = [f"{name}: from {runs[name].least(error)} to {runs[name].most(error)}" for name in CASES]
    return f"largest error of a joint, in mrad; {'; '.join(said)}"


CASES = {"no friction": {}, "friction": {"friction": PANDA.friction}}
CASES["friction, 2 kg"] = CASES["friction"] | {"payload": 2.0}
conditions = {
    name: {label: run(law, **case) for label, law in LAWS.items()} for name, case in CASES.items()
}
title = "An arm with friction and payload"
scene = smc.Scene(title=title, conditions=conditions, film="friction, 2 kg", answer=answer)

if __name__ == "__main__":
    smc.play(__file__)
