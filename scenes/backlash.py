"""How much play in the gear does each law bear before it hammers?

Between motor and joint lies a gap. To reverse, the rotor must cross it, and arrives with speed: every switching of the
command becomes a blow on the other flank.

Look for: the limit cycle (ripple) of each law, and the blows of the flanks (peak reaction), far above max |u|.
"""

import smc_mujoco as smc

scene = smc.Scene(
    title="Inverted pendulum with backlash",
    conditions={
        f"gap {gap:g} rad": smc.paper.comparison(
            "inverted_pendulum", duration=3.0, changes={"actuator": smc.Backlash(gap)}
        )
        for gap in (0.002, 0.01, 0.05)
    },
    film="gap 0.05 rad",
    answers=("ripple", "tv_rate", "peak_reaction"),
)

if __name__ == "__main__":
    smc.play(__file__)
