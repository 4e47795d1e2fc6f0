"""The command line, run in this process, which has loaded all that it needs already, or in one of its own."""

import contextlib
import io
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import pytest

from mrwork.cli import main

COMMAND = (sys.executable, "-m", "mrwork")
# Seconds, for any run of the tests on a busy machine.
PATIENCE = 240.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """How a command line ended."""

    returncode: object
    stdout: str
    stderr: str


def mrwork(*arguments: object) -> Ended:
    """Run a command line in this process, which is that of the run and of its page, too."""
    words = [str(each) for each in arguments]
    with (
        patch.object(sys, "argv", ["mrwork", *words]),
        contextlib.redirect_stdout(io.StringIO()) as out,
        contextlib.redirect_stderr(io.StringIO()) as err,
        pytest.raises(SystemExit) as end,
    ):
        main(words)
    return Ended(returncode=end.value.code, stdout=out.getvalue(), stderr=err.getvalue())


def printed(*arguments: object, status: int = 0) -> str:
    """Text that a command printed: on stderr if it was expected to fail."""
    ended = mrwork(*arguments)
    assert ended.returncode == status, ended.stderr
    return ended.stderr if status else ended.stdout


def ran(
    *command: object,
    env: Mapping[str, str] | None = None,
    cwd: Path | None = None,
    check: bool = False,
    input: str | None = None,
) -> subprocess.CompletedProcess[str]:
    """A process of its own that has ended, with what it printed."""
    words = [str(each) for each in command]
    return subprocess.run(
        words, capture_output=True, text=True, env=env, cwd=cwd, check=check, input=input, timeout=PATIENCE
    )


@contextlib.contextmanager
def started(*command: object) -> Iterator[subprocess.Popen[str]]:
    """A process with pipes for what it prints, killed where the test ends before it."""
    with subprocess.Popen(
        [str(each) for each in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def wait_until(condition: Callable[[], bool], process: subprocess.Popen[str], pause: float = 0.02) -> None:
    """Return once the condition holds, the process has ended or patience has."""
    give_up = time.monotonic() + PATIENCE
    while process.poll() is None and time.monotonic() < give_up and not condition():
        time.sleep(pause)
