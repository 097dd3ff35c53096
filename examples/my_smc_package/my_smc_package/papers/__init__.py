"""Papers: a folder for each. `smc-mujoco claims --paper NAME` audits one."""
