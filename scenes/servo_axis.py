"""Which law keeps a servo axis from sticking and slipping when it crawls at 1 mm/s?

The axis of a published benchmark (95 kg, 20 N of dry friction), here with LuGre's friction, whose
static force is half as large again (chosen). A soft PID waits for its integral to break the axis
loose, shoots ahead, and waits again.

Look for: the staircase of the soft PID; the stiff one crawls evenly after its first step. The
boundary layer lags by a third of a millimetre. Super-twisting follows within 0.1 um, at the price
of a busy motor.
"""

import smc_mujoco as smc

AXIS = smc.plant("servo_axis", cf=0.0)
STICKS = smc.hardware.LuGre(coulomb=20.3935, static=30.6, stribeck=0.005, stiffness=1e6)


def run(law, model="nominal"):
    return smc.Scenario(
        plant=AXIS,
        law=law,
        model=model,
        friction=STICKS,
        x0=0.0,
        reference=smc.signals.Ramp(1e-3),
        u_max=350.0,
    )


RUNS = {
    "soft PID": run(smc.law("pid", kp=3e3, ki=6e3, kd=500.0), "none"),
    "stiff PID": run(smc.law("pid", kp=4e4, ki=2e5, kd=2400.0), "none"),
    "boundary layer": run(smc.law("boundary_layer", k=1.0, c=20.0, phi=0.02)),
    "super-twisting": run(smc.law("super_twisting", k1=1.5, k2=4.0, c=20.0)),
}


def error(trace):
    return 1e6 * ((trace.x - trace.r)[trace.t >= 2.0] ** 2).mean() ** 0.5


def still(trace):
    return 100.0 * (abs(trace.v[trace.t >= 2.0]) < 1e-4).mean()


def answer(runs):
    return (
        f"it sticks and slips with {runs.select(lambda trace: still(trace) > 1.0).named}, "
        "at rest for most of the time, "
        f"in %, with {runs.most(still)}; least rms error, in um, with "
        f"{runs.least(error)}, most with {runs.most(error)}"
    )


scene = smc.Scene(title="Servo axis at 1 mm/s", conditions={"crawling": RUNS}, answer=answer)

if __name__ == "__main__":
    smc.play(__file__)
