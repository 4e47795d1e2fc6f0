"""What the command line sets in its own process, and leaves alone in the process of a calling program."""

import os
import subprocess
import sys

import pytest

TOLD = """
import atexit, gc, os, sys
before = gc.get_threshold()
atexit.register(lambda: print(os.environ.get("OPENBLAS_NUM_THREADS"), gc.get_threshold() == before, file=sys.stderr))
from mrwork.cli import main
"""


def told_by(code: str, **environment: str) -> list[str]:
    """Threads of OpenBLAS at the end of a process, and whether garbage is looked for as before."""
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")
    inherited = {name: value for name, value in os.environ.items() if name not in names}
    run = subprocess.run(
        [sys.executable, "-c", TOLD + code, "--version"],
        env=inherited | environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    return run.stderr.split()


def test_a_command_multiplies_matrices_on_one_thread() -> None:
    assert told_by("main()") == ["1", "False"]


@pytest.mark.parametrize(
    ("name", "threads"), [("OPENBLAS_NUM_THREADS", ["2", "False"]), ("OMP_NUM_THREADS", ["None", "False"])]
)
def test_threads_that_the_user_has_set_stay(name: str, threads: list[str]) -> None:
    assert told_by("main()", **{name: "2"}) == threads


def test_the_process_of_a_calling_program_stays_as_it_is() -> None:
    assert told_by("main(['--version'])") == ["None", "True"]
