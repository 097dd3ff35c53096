"""`python -m smc_mujoco`: the command line, for a shell in which its program is not on the path."""

from smc_mujoco.cli.main import main

if __name__ == "__main__":
    main()
