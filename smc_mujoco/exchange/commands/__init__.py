"""The commands of the exchange annex."""

from smc_mujoco.exchange.commands import c, fmu, live

GROUPS = {  # heading in the help -> name -> command
    "Run and look": {"live": live.live},
    "Exchange": {
        "export-c": c.export_c,
        "check-c": c.check_c,
        "export-fmu": fmu.export_fmu,
        "check-fmu": fmu.check_fmu,
    },
}
