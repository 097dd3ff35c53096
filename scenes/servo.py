"""How much more torque does a servo take to lift a pendulum than to let it down?

A Dynamixel MX-106 swings 1 kg on 15 cm up and down again. Its friction grows with the load on the
gearbox (model M6 of Rhoban's BAM); beside it the same servo with constant and viscous friction
(M1), fitted to the same records. While it lifts, the motor drives its load; while it lowers, the
load drives the motor back.

Look for: the motor's torque at the same angle on the way up and down, which M6 sets further apart
than M1 does; and that it still pushes upwards while it lets the load down.
"""

import smc_mujoco as smc

PENDULUM = smc.plant("inverted_pendulum", m=1.0, l=0.15)
MOVE = smc.signals.Waypoints(
    (0.1, 1.6, 2.0, 3.5), (2.6, 1.2, 1.2, 2.6)
)  # rad from upright; it is heaviest at 1.57
ACROSS = 1.5708  # rad, where the load is m g l


def swinging(model):
    servo = smc.hardware.servo("mx106", model)
    law = smc.law("computed_torque", kp=2500.0, kd=100.0)  # both poles at -50 rad/s
    machine = {"plant": PENDULUM, "actuator": servo.motor, "friction": servo.friction}
    return smc.Scenario(
        law=law, model="nominal", reference=MOVE, x0=2.6, duration=3.8, u_max=12.0, **machine
    )


def torque(trace, up):
    if up:
        passed = (trace.v < -0.1) & (trace.x <= ACROSS)
    else:
        passed = (trace.v > 0.1) & (trace.x >= ACROSS)
    torques = -trace.force[passed]
    return torques[0] if len(torques) else float("nan")  # a short run does not get there


def share(trace):
    down = torque(trace, up=False)
    if down:
        return torque(trace, up=True) / down
    return float("nan")


def answer(runs):
    return (
        "where the pendulum is level, the motor's torque to lift "
        "it over that to let it down is largest with "
        f"{runs.most(share)} and smallest with {runs.least(share)}"
    )


scene = smc.Scene(
    title="A pendulum on a servo",
    conditions={"up and down": {"M6, by load": swinging("m6"), "M1, constant": swinging("m1")}},
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
