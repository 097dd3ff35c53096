"""Relay or super-twisting: which chatters less, and at which lag of the actuator does that change?

Both laws tolerate the disturbance sin(t) N on a free mass: the relay k sgn(s) needs k > 1 N,
super-twisting a rate of 1 N/s. The actuator lags twice by the same time constant mu. The amplitude
of the relay grows with mu, that of super-twisting with mu^2 (V. Utkin, "Discussion aspects of
high-order sliding mode control", IEEE TAC 61(3):829, 2016; U. Perez-Ventura & L. Fridman, arXiv
1705.09711).

Look for: the lines of the figure, predicted by harmonic balance, and the dots, run; where they
cross.
"""

import smc_mujoco as smc

LAWS = {
    "relay": smc.law("classical", k=1.1, c=0.01),
    "super-twisting": smc.law(
        "super_twisting", k1=1.5, k2=1.1, c=0.01
    ),  # Levant's gains for a rate of 1 N/s
}
LAGS = (2, 5, 10, 20, 50, 100, 200, 300)  # ms, the sum of both


def scenario(law, lag):
    mu = lag / 2000
    return smc.Scenario(
        plant=smc.plant("servo_axis", M=1.0, b=0.0, cf=0.0, offset=0.0),
        law=law,
        actuator=(smc.Lag(mu), smc.Lag(mu)),
        control_period=1e-3,
        x0=0.0,
        v0=0.01,
        duration=1.0 + 0.25 * lag,  # the last fifth has nine periods or more
    )


def amplitude(trace):
    return max(0.0, smc.score(trace)["chattering_amplitude"])  # 0 for NaN, too


scene = smc.Scene(
    title="Relay and super-twisting behind a lagging actuator",
    conditions={
        f"{lag} ms": {label: scenario(law, lag) for label, law in LAWS.items()} for lag in LAGS
    },
    film="20 ms",
    figure="chattering",
    answers=("chattering_amplitude", "chattering_frequency"),
    answer=lambda runs: (
        f"the smaller amplitude of s, over the lag: {runs.least(amplitude, unit='m/s')}"
    ),
)

if __name__ == "__main__":
    smc.play(__file__)
