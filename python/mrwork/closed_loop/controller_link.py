"""Links to a controller outside Python: a program over its stdin and stdout, or a UDP port.

Only this module starts a program of the user or opens a socket (`tests/test_trust.py`). An answer begins with the
number of its message, so that one that comes late is never taken for that of a later sample.
"""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import sys
from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from secrets import randbelow
from threading import Lock
from time import monotonic
from typing import IO, ClassVar, Final

from mrwork.errors import SettingError, reason_of

NUMBER: Final = 8
"""Bytes of a number."""
# More than any answer, so that one read takes all there is.
_CHUNK = 1 << 16
# Time in which a program ends after its stdin did, before it is killed, and the rest of a first answer comes [s].
_LEAVE = 1.0
# Kills a group of processes where its own stdin ends without a line: then this process has ended.
_GUARD = 'read -r line || kill -s KILL -- "-$1" 2>/dev/null'
# Loops of this process that talk to an address, one after the other.
_AT_WORK: Final[defaultdict[tuple[str, int], Lock]] = defaultdict(Lock)


class LinkEndedError(Exception):
    """The controller has ended, or nothing listens at its port; the text says which."""


class Link(ABC):
    """A controller that takes a message and gives an answer of `size` bytes."""

    __slots__ = ("size", "strayed")
    # Where to look for why it has ended, and until when it is to answer.
    look: ClassVar[str]
    until: ClassVar[str]

    def __init__(self, size: int) -> None:
        self.size = size
        # The last answer that was not to its message.
        self.strayed = b""

    @abstractmethod
    def exchange(self, message: bytes, seconds: float, *, is_first: bool = False) -> bytes:
        """The answer to a message: shorter or longer than `size` as it came, empty where none came in time.

        What is no answer to the first message of a program is returned at once, in `strayed`.

        Raises
        ------
        LinkEndedError
            If the controller has ended.
        """

    @abstractmethod
    def close(self) -> None:
        """End the link, and the program."""


def session_number() -> int:
    """A number of a session, which tells its messages at a port from those of another loop: 1 to 2^20."""
    return 1 + randbelow(1 << 20)


def _wait(entry: int, event: int, until: float) -> bool:
    """Whether an entry is ready before a time."""
    watch = select.poll()
    watch.register(entry, event)
    return bool(watch.poll(max(0.0, until - monotonic()) * 1e3))


class Pipe(Link):
    """A program of the user, which this process starts and ends."""

    __slots__ = ("_guard", "_process", "_reader", "_writer")
    look = "see what it wrote on stderr"
    until = "its stdin ends"

    def __init__(self, program: Sequence[str], size: int) -> None:
        super().__init__(size)
        if sys.platform == "win32":
            raise SettingError(
                "a controller over a pipe needs Linux or macOS; start it yourself, and give its UDP address"
            )
        try:
            # In a session of its own, Ctrl-C reaches it by this process alone, and it is ended with all it has started.
            self._process = subprocess.Popen(
                [*program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0, start_new_session=True
            )
        except OSError as error:
            raise SettingError(
                f"the program {program[0]} does not start: {reason_of(error)}; give an executable, with its folder or "
                "found by the PATH, and its arguments each apart"
            ) from error
        guard = ["/bin/sh", "-c", _GUARD, "sh", str(self._process.pid)]
        self._guard = subprocess.Popen(guard, stdin=subprocess.PIPE, start_new_session=True)
        self._writer, self._reader = (stream.fileno() for stream in self._streams)
        os.set_blocking(self._writer, False)

    @property
    def _streams(self) -> tuple[IO[bytes], IO[bytes]]:
        """The stdin and the stdout of the program."""
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        return stdin, stdout

    def exchange(self, message: bytes, seconds: float, *, is_first: bool = False) -> bytes:
        """The answer to a message; those to earlier ones are dropped."""
        until = monotonic() + seconds
        if not self._write(message, until):
            return b""
        answer = b""
        # A program that writes without end is always ready.
        while monotonic() < until and _wait(self._reader, select.POLLIN, until):
            read = os.read(self._reader, _CHUNK)
            if not read:
                raise self._ended()
            answer += read
            place = 0
            while len(answer) - place >= self.size:
                if answer[place : place + NUMBER] == message[:NUMBER]:
                    return answer[place:]
                self.strayed, place = answer[place : place + self.size], place + self.size
                if is_first:
                    return b""
            answer = answer[place:]
            if is_first:
                until = min(until, monotonic() + _LEAVE)
        return answer

    def _write(self, message: bytes, until: float) -> bool:
        """Whether the program took a message in time."""
        while message:
            try:
                message = message[os.write(self._writer, message) :]
            except BlockingIOError:
                if monotonic() > until or not _wait(self._writer, select.POLLOUT, until):
                    return False
            except BrokenPipeError:
                raise self._ended() from None
        return True

    def _ended(self) -> LinkEndedError:
        try:
            status = self._process.wait(_LEAVE)
        except subprocess.TimeoutExpired:
            return LinkEndedError("closed its stdin or stdout")
        if status < 0:
            return LinkEndedError(f"ended by signal {-status} ({signal.strsignal(-status)})")
        return LinkEndedError(f"ended with status {status}")

    def close(self) -> None:
        """End the program, by the end of its stdin or by a signal, and what it has started."""
        stdin, stdout = self._streams
        stdin.close()
        try:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(_LEAVE)
        finally:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
            stdout.close()
            self._guard.communicate(b"\n")


class UdpPort(Link):
    """A controller at a UDP port, which somebody else has started: a message and an answer are a datagram each."""

    __slots__ = ("_address", "_socket", "_turn")
    look = "see whether it runs and listens at that port"
    until = "the simulation ends"

    def __init__(self, address: tuple[str, int], size: int, seconds: float) -> None:
        super().__init__(size)
        self._address = "{}:{}".format(*address)
        # A controller has one memory.
        self._turn = _AT_WORK[address]
        if not self._turn.acquire(timeout=seconds):
            raise SettingError(
                f"another loop of this process talks to {self._address}; simulate one after the other, or give each a "
                "controller at a port of its own"
            )
        try:
            found = socket.getaddrinfo(*address, type=socket.SOCK_DGRAM)
            # A name may be that of both families, and controllers listen at the older one.
            found.sort(key=lambda entry: entry[0] != socket.AF_INET)
            family, kind, protocol, _, place = found[0]
            self._socket = socket.socket(family, kind, protocol)
            self._socket.connect(place)
        except OSError as error:
            self._turn.release()
            raise SettingError(
                f"there is no way to {self._address}: {reason_of(error)}; give a host and a port"
            ) from error

    def exchange(self, message: bytes, seconds: float, *, is_first: bool = False) -> bytes:
        """The answer to a message; datagrams to earlier ones, or to another session, are dropped."""
        until = monotonic() + seconds
        try:
            self._socket.send(message)
            while (left := until - monotonic()) > 0.0:
                self._socket.settimeout(left)
                answer = self._socket.recv(_CHUNK)
                if len(answer) != self.size or answer[:NUMBER] == message[:NUMBER]:
                    return answer
                self.strayed = answer
        except TimeoutError:
            pass
        except OSError as error:
            raise LinkEndedError(f"is not reached at {self._address} ({reason_of(error)})") from error
        return b""

    def close(self) -> None:
        """Leave the port; the controller goes on."""
        self._socket.close()
        self._turn.release()
