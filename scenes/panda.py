"""What do joint friction and a payload that the law does not know do to an arm that moves between two poses?

The Panda goes from its home pose to its ready pose in 3 s. First its joints do not rub, then they have the friction that
Gaz et al. identified, and at last the arm also holds 2 kg, of which no law knows. The laws know the mass matrix and the
gravity of the bare arm. Gains are chosen by hand, larger for the joints that move little mass.

Look for: friction shows on the last joint, which it needs ten times the torque to move. Super-twisting follows within
1 mrad whatever rubs or hangs there; the boundary layer lags by 12 mrad, and by more with the payload.
"""

import smc_mujoco as smc

PANDA = smc.plant("panda")
THERE = [smc.Waypoints((0.0, 3.0), pair) for pair in zip(PANDA.x0, PANDA.rest, strict=True)]
JERK = [100.0, 100.0, 100.0, 400.0, 400.0, 2000.0, 2000.0]  # rad/s^3: more for the joints that move little mass
LAWS = {
    "boundary layer": smc.law(
        "computed_torque_sliding", k=[30.0, 20.0, 30.0, 40.0, 60.0, 100.0, 200.0], c=10.0, width=0.4
    ),
    "super-twisting": smc.law(
        "super_twisting_computed_torque", k1=[1.5 * L**0.5 for L in JERK], k2=[1.1 * L for L in JERK], c=10.0
    ),
    "passivity": smc.law(
        "passivity_based", K=[20.0, 60.0, 20.0, 40.0, 5.0, 5.0, 1.0], k=[2.0, 20.0, 2.0, 10.0, 1.0, 1.0, 1.0], c=10.0
    ),
    "time delay": smc.law(
        "time_delay_sliding", m=[0.02, 0.4, 0.02, 0.1, 0.015, 0.01, 0.003], k=20.0, c=10.0, width=0.4
    ),
}


def run(law, friction, payload):
    mismatch = {"payload": payload}
    return smc.Scenario(plant=PANDA, law=law, reference=THERE, friction=friction, mismatch=mismatch, duration=4.0)


def error(trace):
    return 1e3 * abs(trace.x - trace.r).max()


def answer(runs):
    free, friction, payload = runs["no friction"], runs["friction"], runs["friction, 2 kg"]
    return (
        f"largest error of a joint, in mrad: without friction at most {free.most(error)}; with it from "
        f"{friction.least(error)} to {friction.most(error)}; with 2 kg more from {payload.least(error)} to "
        f"{payload.most(error)}"
    )


scene = smc.Scene(
    title="An arm with friction and an unknown payload",
    conditions={
        "no friction": {label: run(law, None, 0.0) for label, law in LAWS.items()},
        "friction": {label: run(law, PANDA.friction, 0.0) for label, law in LAWS.items()},
        "friction, 2 kg": {label: run(law, PANDA.friction, 2.0) for label, law in LAWS.items()},
    },
    film="friction, 2 kg",
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
