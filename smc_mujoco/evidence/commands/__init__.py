"""The commands of the evidence annex."""

from smc_mujoco.evidence.commands import accuracy, boards, certificates, papers, report, rigs

GROUPS = {  # heading in the help -> name -> command
    "Compare": {"board": boards.board},
    "Tune and analyse": {"accuracy": accuracy.accuracy},
    "Audit": {
        "claims": papers.claims,
        "papers": papers.papers,
        "certify": certificates.certify,
        "report": report.report,
    },
    "Machines": {"identify": rigs.identify, "replay": rigs.replay},
}
