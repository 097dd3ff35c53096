"""Does a drone turn by 320 degrees where 40 would do?

Two quaternions, q and -q, are one attitude. A hovering Crazyflie turns its heading by 40 degrees
under the attitude's part of `quaternion_sliding`, s = w + lam sgn(q0) qz. Its quaternion starts as
either of the two, and never jumps from one to the other. One law has the sign of q0 in s, the other
1 in its place.

Look for: the drone without the sign that starts with -q. It turns away from where it has to be, and
unwinds.
"""

import math

import smc_mujoco as smc

DRONE = smc.plant("quadrotor")
GAINS = {
    "sgn": 1.0,
    "first": 1.0,
    "lam": 8.0,
    "K": 400.0,
    "rho": 0.25,
}  # sgn: 0 without the sign; first: sign of q0


@smc.law_function(joint=True, requires_model=True, plants=("a free body",), gains=GAINS, memory=2)
def turning(y, gains, memory):
    lam = gains.lam[5]
    last = memory[5]
    s = y.de + 5.0 * y.e
    u = y.h - y.M @ (20.0 * y.de + 100.0 * y.e)  # a PD law keeps the height, and the body level
    q0 = math.cos(0.5 * y.e[5])
    qz = math.sin(0.5 * y.e[5])
    if last[0] * q0 + last[1] * qz < 0.0 or (y.t == 0.0 and gains.first[5] < 0.0):
        q0, qz = -q0, -qz
    last[:] = q0, qz
    if q0 < 0.0 and gains.sgn[5] == 1.0:
        sign = -1.0
    else:
        sign = 1.0
    s[5] = y.de[5] + lam * sign * qz
    u[5] = y.h[5] - y.M[5, 5] * (
        0.5 * lam * sign * q0 * y.de[5] + gains.K[5] * math.tanh(gains.rho[5] * s[5])
    )
    return u, s


def turned(trace):
    return math.degrees(sum(abs(trace.v[:-1, 5])) * trace.t[1])


scene = smc.Scene(
    title="Unwinding",
    conditions={
        f"from {start}": {
            label: smc.Scenario(
                plant=DRONE,
                law=turning(sgn=sgn, first=first),
                x0=(0, 0, 1, 0, 0, 0.698),
                duration=4.0,
            )
            for label, sgn in (("with sgn(q0)", 1.0), ("without", 0.0))
        }
        for start, first in (("q", 1.0), ("-q", -1.0))
    },
    film="from -q",
    answer=lambda runs: "; ".join(
        f"{x} it turns by {runs.only(x).size(turned, 'degrees')}" for x in runs.labels
    ),
)

if __name__ == "__main__":
    smc.play(__file__)
