"""The command line, run in this process."""

from __future__ import annotations

import pytest

from mrwork.cli import main


def printed(capsys: pytest.CaptureFixture[str], *arguments: object, status: int = 0) -> str:
    """What a command printed: on stderr where it was to fail."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        main([str(each) for each in arguments])
    captured = capsys.readouterr()
    assert ended.value.code == status, captured.err
    return captured.err if status else captured.out
