"""The commands of the evidence annex."""

from smc_mujoco.evidence.commands import accuracy, boards, certificates, papers, report, rigs

GROUPS = {  # heading in the help -> commands
    "Compare": [boards.board],
    "Tune and analyse": [accuracy.accuracy],
    "Audit": [papers.claims, papers.papers, certificates.certify, report.report],
    "Machines": [rigs.identify, rigs.replay],
}
