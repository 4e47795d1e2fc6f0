"""Output of a command on stdout and stderr, without characters that would control the terminal."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from pathlib import Path

from mrwork.errors import OutputError, escape_text, escaped_lines

# Length of the line that is open on stderr.
_LINE = [0]


def show(text: str) -> None:
    """Print a text on stdout; where its reader has left, as head does, the text is lost and the work goes on."""
    _write_text(f"{escaped_lines(text)}\n")


def show_all() -> None:
    """Flush text that other code has written on stdout."""
    _write_text("")


def note(sentence: str, *more: str) -> None:
    """Print a message in one line on stderr, in place of a line that is written again, and more below it."""
    clear = f"\r{' ' * _LINE[0]}\r" if _LINE[0] else ""
    lines = "".join(f"{escape_text(line)}\n" for line in (f"mrwork: {sentence}", *more))
    write_stderr(clear + lines)


def write_stderr(text: str) -> None:
    """Write text on stderr unchanged; if that fails, the text is lost and the computation continues."""
    if text:
        _LINE[0] = len(text.rpartition("\n")[2].rpartition("\r")[2])
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.write(text)
        sys.stderr.flush()


def keep_stdout() -> contextlib.AbstractContextManager[object]:
    """Reserve stdout for the command: what Python code prints in the block, as a law of the user, goes to stderr."""
    return contextlib.redirect_stdout(sys.stderr)


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
            if stream is not None and not stream.closed:
                stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _write_text(text: str) -> None:
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:
        return
    except OSError as reason:
        raise OutputError(
            f"standard output cannot be written ({reason.strerror}); free some space, or redirect it elsewhere"
        ) from None
    except ValueError:
        # Only code within this process can do so, as a law in Python.
        raise OutputError(
            "standard output was closed while the command ran; leave sys.__stdout__ open"
        ) from None
