"""What a command prints, and where: text without characters that would command the terminal."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from pathlib import Path

from mrwork.errors import OutputError
from mrwork.escaping import escaped, escaped_lines


def show(text: str) -> None:
    """Print a text on stdout; where its reader has left, as head does, the text is lost and the work goes on.

    Raises
    ------
    OutputError
        Where stdout cannot be written.
    """
    _written(f"{escaped_lines(text)}\n")


def show_all() -> None:
    """Print what others have written on stdout and it still holds back.

    Raises
    ------
    OutputError
        Where stdout cannot be written.
    """
    _written("")


def note(sentence: str) -> None:
    """Print a message in one line on stderr."""
    write_stderr(f"mrwork: {escaped(sentence)}\n")


def write_stderr(text: str) -> None:
    """Write on stderr as it is; where that is impossible, the text is lost and the computation goes on."""
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.write(text)
        sys.stderr.flush()


def take_streams() -> bool:
    """Let stdout and stderr of this process take every character; whether there is a stdout."""
    # A stream that was closed when the process started is `None`, and its number would go to the next file.
    if sys.stderr is None:
        sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115 # for as long as the process lives
    if sys.stdout is None:
        note("standard output is closed; leave it open, or redirect it to a file or /dev/null")
        return False
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    return True


def let_go() -> None:
    """Drop what stdout and stderr could not take, which the interpreter would try again when it ends."""
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _written(text: str) -> None:
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        return
    except OSError as reason:
        raise OutputError(
            f"standard output cannot be written ({reason.strerror}); free some space, or redirect it elsewhere"
        ) from None
