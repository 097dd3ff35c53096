"""The commands of the exchange annex."""

from smc_mujoco.exchange.commands import c, fmu, live

COMMANDS = {
    "live": live.live,
    "check-c": c.check_c,
    "export-c": c.export_c,
    "check-fmu": fmu.check_fmu,
    "export-fmu": fmu.export_fmu,
}
