"""How a command refuses."""

import pytest

from smc_mujoco.cli import main


def assert_refused(capsys, words, said):
    """Fail unless a command ends with code 2 and one line that begins so."""
    with pytest.raises(SystemExit) as end:
        main.main(words)
    printed = capsys.readouterr()
    assert (end.value.code, printed.out) == (2, "")
    assert printed.err.startswith(f"smc-mujoco: {said}")
    assert len(printed.err.splitlines()) == 1
