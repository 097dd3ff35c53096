"""The program `smc-mujoco`, and `python -m smc_mujoco` for a shell in which it is not on the path.

Ctrl-C ends it from here on, before it imports what takes time.
"""

from smc_mujoco.common.attended import end_at_ctrl_c


def main() -> None:
    """Run the command line as the program of this process."""
    end_at_ctrl_c()
    from smc_mujoco.cli.main import main as run

    run()


if __name__ == "__main__":
    main()
