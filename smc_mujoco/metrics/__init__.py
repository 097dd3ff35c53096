"""From a trace to numbers."""

from smc_mujoco.common.deprecated import old_names

_MOVED = """
    energy hf_share iae ise itae max_step max_u mean_settling_time metrics overshoot peak peak_reaction reaching_time
    reversal_rate ripple rise_time score scores settling_time spread_bound spread_settling_time steady_error stick_time
    tv tv_rate ultimate_bound
"""
__getattr__ = old_names(__name__, dict.fromkeys(_MOVED.split(), "smc_mujoco.metrics.catalogue"))
