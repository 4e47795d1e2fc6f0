"""The command line: one module per verb, each with `add_options` and `run`.

Exit status: 0 done; 2 bad input, or no stdout, space or memory (one line on stderr); 130 interrupted by Ctrl-C,
143 ended by SIGTERM (what was finished is kept).

What is slow to load, and a help does without, is imported within the functions of a verb.
"""

from __future__ import annotations

import gc
import os
import sys

from mrwork.cli.signals import StopSignals

# Nothing else is loaded here: until `main` runs, Ctrl-C is a traceback.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import NoReturn

# Objects made since the last look for garbage in cycles; 700 by default, which takes a tenth of the time of a page. A
# help makes fewer.
_OBJECTS_PER_COLLECTION = 100_000


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run a command line and exit with its status.

    Without `arguments` it is this process's, whose signals and streams are then taken over; with them, signals and
    streams stay the calling program's.
    """
    signals = StopSignals.of_this_process() if arguments is None else StopSignals()
    if arguments is None:
        _set_up_process()
    from mrwork.cli.door import status_of
    from mrwork.cli.terminal import let_go, take_streams

    if arguments is not None:
        sys.exit(status_of(arguments, signals))
    status = status_of(sys.argv[1:], signals) if take_streams() else 2
    # All files are written: from here on a signal changes nothing.
    signals.leave_with(status)
    let_go()
    # The output is complete; what other code prints as the interpreter ends is no part of it.
    sys.stdout = sys.stderr
    if status == signals.status:
        # Another thread may still run compiled code that does not notice the interrupt.
        os._exit(status)
    sys.exit(status)


def _set_up_process() -> None:
    """Settings of the interpreter for the time of a command, before NumPy loads."""
    gc.set_threshold(_OBJECTS_PER_COLLECTION)
    if "OMP_NUM_THREADS" not in os.environ:
        # Matrices are small here: threads of OpenBLAS would wait for each other, keep simulations waiting, and sum in
        # an order that depends on their number.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
