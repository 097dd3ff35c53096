"""The commands of the evidence annex."""

from smc_mujoco.evidence.commands import certificates, papers, report, rigs

GROUPS = {  # heading in the help -> commands
    "Audit": [papers.claims, certificates.certify, report.report],
    "Machines": [rigs.rig],
}
