"""Which law swings a rotary pendulum up, catches it and holds it, with friction in the bearing of
its arm?

All pump energy in the same way (K. J. Astrom & K. Furuta 2000), through the nominal model of the
arm, and catch the pendulum on the surface s = b'P z of least quadratic cost. They differ in how
they come to s = 0: by a relay, by one with a boundary layer, by super-twisting, or by u = -s, which
is the linear quadratic regulator.

Look for: all are up in 1.2 s. With friction in the arm, the regulator and the layer rock it back
and forth, and the relay chatters anyway. Under super-twisting it comes to rest, once the integral
balances the friction.
"""

import smc_mujoco as smc

HANGING = (
    -3.1416
)  # rad: just past -pi, from where the way up that the laws take ends at 0 and not at -2 pi
LAWS = {
    "relay": smc.law("rotary_swing_up", k=0.04, phi=1e-4, k1=0.0, k2=0.0),
    "boundary layer": smc.law("rotary_swing_up", k=0.05, phi=0.025, k1=0.0, k2=0.0),
    "super-twisting": smc.law("rotary_swing_up"),
    "regulator": smc.law("rotary_swing_up", k=1.0, phi=1.0, k1=0.0, k2=0.0),
}


def run(friction, law):
    plant = smc.plant("furuta", cf=friction)
    return smc.Scenario(plant=plant, law=law, x0=(0.0, HANGING), control_period=2e-3, duration=6.0)


def rocking(trace):
    return 57.3 * (trace.x[-1000:, 0].max() - trace.x[-1000:, 0].min())


def answer(runs):
    rubs = runs["arm rubs"]
    up = rubs.select(lambda trace: abs(trace.x[-1, 1]) < 0.1)
    least = rubs.least(rocking)
    most = rubs.most(rocking)
    upright = f"with friction in the arm, the pendulum stays up under {up.named}"
    return f"{upright}; the arm rocks least, in degrees, with {least}, most with {most}"


scene = smc.Scene(
    title="Furuta pendulum",
    conditions={
        "no friction": {label: run(0.0, law) for label, law in LAWS.items()},
        "arm rubs": {label: run(0.002, law) for label, law in LAWS.items()},
    },
    film="arm rubs",
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
