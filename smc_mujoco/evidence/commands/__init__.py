"""The commands of the evidence annex."""

from smc_mujoco.evidence.commands import certificates, papers, report

GROUPS = {  # heading in the help -> commands
    "Audit": [papers.claims, certificates.certify, report.report],
}
