"""Output of a command on stdout and stderr, without characters that would control the terminal."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

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
    lines = "".join(f"{escape_text(each)}\n" for each in (f"mrwork: {sentence}", *more))
    write_stderr(clear + lines)


def write_stderr(text: str) -> None:
    """Write text on stderr unchanged; if that fails, the text is lost and the computation continues."""
    if text:
        _LINE[0] = len(text.rpartition("\n")[2].rpartition("\r")[2])
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.write(text)
        sys.stderr.flush()


@contextlib.contextmanager
def keep_stdout() -> Iterator[None]:
    """Reserve stdout for the command: redirect other output in the block, as of a law in Python, to stderr.

    Where the streams are those of the process, that holds for its child processes and compiled code, too.
    """
    kept, shared = sys.stdout, _number(sys.stdout) == 1 and _number(sys.stderr) == 2
    with contextlib.ExitStack() as undo:
        undo.callback(setattr, sys, "stdout", kept)
        if shared:
            kept.flush()
            undo.callback(_redirect, os.dup(1))
            os.dup2(2, 1)
            # Not stderr itself, which somebody may close by this name.
            sys.stdout = undo.enter_context(
                open(2, "w", encoding=kept.encoding, errors="backslashreplace", buffering=1, closefd=False)
            )
            # What was printed on the stream of before goes where stdout leads now.
            undo.callback(_flush, kept)
        else:
            sys.stdout = sys.stderr
        yield


def _redirect(number: int) -> None:
    """Let stdout lead where the file of this number does, which is closed."""
    os.dup2(number, 1)
    os.close(number)


def _flush(stream: TextIO) -> None:
    with contextlib.suppress(OSError, ValueError):
        stream.flush()


def _number(stream: TextIO) -> int:
    """Number of the file of a stream; -1 if it has none."""
    try:
        return stream.fileno()
    except (OSError, ValueError, AttributeError):
        return -1


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
