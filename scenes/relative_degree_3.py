"""Behind an actuator that lags by 50 ms: which laws of third order settle, with an acceleration
that is estimated?

The paper gives its law for any relative degree r, as -lambda tanh of x^(r-1) + ... + k1 x, and
shows r = 2. A lag makes r = 3: the law needs x'', which Levant's differentiator gives, its L
between g U / tau and twice that.

Look for: whether the paper's form settles, beside the nested third-order law, a surface of third
order under the classical law, and the second-order form that does not know of the lag.
"""

import smc_mujoco as smc


def answer(runs):
    return (
        f"{runs.count('settle')}; first: {runs.least('settling_time')}; "
        f"last: {runs.most('settling_time')}; "
        f"the largest final error: {runs.most('ultimate_bound')}"
    )


scene = smc.Scene(
    title="Relative degree 3",
    conditions={
        condition: {
            label: smc.Scenario(
                plant=plant,
                law=law,
                surface=surface,
                duration=6.0,
                actuator=smc.Lag(0.05),
                velocity=smc.estimator("levant", L=jerk),
            )
            for label, law, surface in (
                ("third order", "observer_free_third", None),
                ("second order", "observer_free", None),
                ("nested", "nested_third_order", None),
                ("classical, 3rd", "classical", "higher_order"),
            )
        }
        for condition, plant, jerk in (
            ("Duffing", "duffing", 200.0),
            ("inverted pendulum", "inverted_pendulum", 1000.0),
        )
    },
    answers=("settling_time", "ultimate_bound", "tv_rate"),
    answer=answer,
)

if __name__ == "__main__":
    smc.play(__file__)
