"""Whatever is given to the compiled module, it returns or refuses: no panic, no signal, no memory without limit."""

from __future__ import annotations

import os
import re
import sys

from command_line import ran
from examples import TIMES

COUNT = 400 * TIMES


def test_calls_with_arguments_of_any_kind_return_or_are_refused_in_a_sentence() -> None:
    paths = os.pathsep.join(filter(None, sys.path))
    words = (sys.executable, "-m", "tools.faults.boundary_sweep", COUNT)
    done = ran(*words, env=os.environ | {"PYTHONPATH": paths, "OMP_NUM_THREADS": "1"})
    assert done.returncode == 0, done.stderr[-4000:]
    counts = {what: int(count) for count, what in re.findall(r"(\d+) ([a-z][a-z ]*[a-z])", done.stdout)}
    assert counts.keys() <= {"accepted", "refused", "stopped"}, done.stdout
    assert min(counts["accepted"], counts["refused"]) > 0
