"""The command line, called with arguments of any type."""

from __future__ import annotations

import pytest
from commands import Output

from geodesic_ocp.cli import main as cli


@pytest.fixture
def printed(capsys: pytest.CaptureFixture[str]) -> Output:
    """What a command that succeeds prints."""

    def output_of(*arguments: object) -> str:
        assert cli.main([*map(str, arguments)]) == 0
        return capsys.readouterr().out

    return output_of


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Output:
    """What a command says of wrong input, with which it ends."""

    def message_of(*arguments: object) -> str:
        assert cli.main([*map(str, arguments)]) == 2
        return capsys.readouterr().err

    return message_of
