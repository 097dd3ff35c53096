"""The commands of the evidence annex."""

from smc_mujoco.evidence.commands import boards, certificates, papers, report, rigs

GROUPS = {  # heading in the help -> name -> command
    "Compare": {"board": boards.board},
    "Audit": {
        "claims": papers.claims,
        "papers": papers.papers,
        "certify": certificates.certify,
        "report": report.report,
    },
    "Machines": {"identify": rigs.identify, "replay": rigs.replay},
}
