"""The commands of the evidence annex."""

from smc_mujoco.evidence.commands import papers

GROUPS = {  # heading in the help -> commands
    "Audit": [papers.claims],
}
