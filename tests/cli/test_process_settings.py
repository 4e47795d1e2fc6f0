"""What the command line sets in its own process, and leaves alone in the process of a calling program."""

import subprocess
import sys

TOLD = """
import atexit, gc, sys
before = gc.get_threshold()
atexit.register(lambda: print(gc.get_threshold()[0] > before[0], file=sys.stderr))
from mrwork.cli import main
"""


def told_by(code: str) -> str:
    """Whether garbage is looked for less often at the end of a process than at its start."""
    run = subprocess.run(
        [sys.executable, "-c", TOLD + code, "--version"],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    return run.stderr.strip()


def test_a_command_looks_for_garbage_less_often() -> None:
    assert told_by("main()") == "True"


def test_the_process_of_a_calling_program_stays_as_it_is() -> None:
    assert told_by("main(['--version'])") == "False"
