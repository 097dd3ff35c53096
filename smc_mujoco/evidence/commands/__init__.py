"""The commands of the evidence annex."""

from smc_mujoco.evidence.commands import boards, certificates, papers, report, rigs

COMMANDS = {
    "board": boards.board,
    "identify": rigs.identify,
    "replay": rigs.replay,
    "certify": certificates.certify,
    "claims": papers.claims,
    "papers": papers.papers,
    "report": report.report,
}
