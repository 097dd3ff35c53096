"""The commands of the evidence annex."""

from smc_mujoco.evidence.commands import accuracy, certificates, papers, report, rigs

GROUPS = {  # heading in the help -> commands
    "Tune and analyse": [accuracy.accuracy],
    "Audit": [papers.claims, certificates.certify, report.report],
    "Machines": [rigs.rig],
}
