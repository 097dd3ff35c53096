"""The commands of the evidence annex."""

from smc_mujoco.evidence.commands import papers, report

GROUPS = {  # heading in the help -> commands
    "Audit": [papers.claims, report.report],
}
