"""Controls of the problems: laws that are no entries.

- zero: u = 0. It must reach no target of any problem.
"""

from smc_mujoco.control.from_text import law
from smc_mujoco.control.law import Law


def laws() -> dict[str, Law]:
    """Return the controls by name."""
    return {"zero": law("none").named("zero")}
