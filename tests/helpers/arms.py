"""A small arm of a user's own MJCF, for the tests of laws of many joints."""

import functools

import smc_mujoco as smc
from smc_mujoco.control.law import FREE_BODY, joint_law_catalogue
from smc_mujoco.mechanisms.plant import Plant

# laws that an arm can have; those of a free body take parts of arrays, which have no translation
# into C
LAWS = {name: law for name, law in joint_law_catalogue().items() if FREE_BODY not in law.plants}

ARM = """
<mujoco model="arm">
  <default><geom type="capsule" size="0.03" contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="turn" axis="0 0 1" damping="0.1" armature="0.02"/>
      <geom fromto="0 0 0 0 0 0.2" mass="1.5"/>
      <body pos="0 0 0.2">
        <joint name="lift" axis="0 1 0" stiffness="2" springref="0.2"/>
        <geom fromto="0 0 0 0.4 0 0" mass="0.8"/>
        <body name="hand" pos="0.4 0 0">
          <joint name="reach" type="slide" axis="1 0 0" damping="0.3"/>
          <geom fromto="0 0 0 0.2 0 0" mass="0.5"/>
          <site name="tip" pos="0.2 0 0.05"/>
        </body>
      </body>
    </body>
    <body pos="3 0 0">
      <joint name="apart" axis="0 1 0"/>
      <geom fromto="0 0 0 0 0 -1" mass="1"/>
    </body>
  </worldbody>
  <actuator>
    <motor joint="turn"/><motor joint="lift" gear="5"/><motor joint="reach"/><motor joint="apart"/>
  </actuator>
</mujoco>
"""


@functools.cache
def arm() -> Plant:
    """Three joints of two units, driven in another order than the model's, beside a tree without a
    channel.
    """
    return smc.plant_from(ARM, channels=["reach", "turn", "lift"], name="arm", tip="tip")
