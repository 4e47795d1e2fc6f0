"""A control law outside Python: a program over a pipe, or a controller at a UDP port, asked at every control sample."""

from __future__ import annotations

import struct
from array import array
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from shutil import which
from time import perf_counter
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import checked
from mrwork.base.hints import Within
from mrwork.base.keys import key, optional, positive
from mrwork.base.numbers import counted
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.table import Table
from mrwork.base.values import Floats
from mrwork.buildings.device import Device
from mrwork.buildings.groups import commanded
from mrwork.buildings.plane_building import Building
from mrwork.closed_loop.controller_link import NUMBER, Link, LinkEndedError, Pipe, UdpPort, session_number
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.loop_sample import READINGS
from mrwork.closed_loop.responses import command_unit_of
from mrwork.closed_loop.round_trips import LostController, RoundTrips
from mrwork.closed_loop.rows_law import Ask, AskOfRuns
from mrwork.control.laws.control_law import ControlLaw
from mrwork.errors import SettingError
from mrwork.store.codec import digest_of

Reading = Literal[
    "displacement",
    "velocity",
    "deformation",
    "rate",
    "force",
    "acceleration",
    "ground_acceleration",
    "ground_velocity",
    "drift",
]
_HEAD: Final = {"message": "", "sample": "", "time": "s", "missed": ""}
# Messages in a row without an answer after which a controller hangs.
_HANGS = 3
_FAILURES = ("unanswered", "misshapen", "not_finite")


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerNumbers:
    """Numbers of a message or an answer that stand together: the place of the first, and what each is `of`."""

    _made_by: ClassVar[str] = "law.protocol(building, devices).message"

    first: int
    name: str
    unit: str
    of: tuple[str, ...] = ()

    @property
    def end(self) -> int:
        """The place after the last one."""
        return self.first + max(len(self.of), 1)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ControllerProtocol(Summarised):
    """What a controller outside Python reads and writes at each sample, in a loop at hand.

    At each control sample the loop sends one message, waits, and takes one answer, both little-endian doubles (IEEE
    754) without gaps. A message has

    - `message`, a number that grows by 1 from message to message, from 1 on; over UDP from 1 + s 2^32 on, where s is
      the number of the session, by which a controller tells this loop from another one at its port,
    - `sample`, the number of the sample in its run: **at 0 a run begins, and the controller forgets what it has kept**,
    - `time` from the start of the motion [s],
    - `missed`, the number of samples of this run so far of which no answer was taken,
    - the readings in the order of a `LoopSample`, each of all its places.

    An answer has `message`, as it came, and then one command for each device that is commanded [A or V; of an actuator
    N]. The first number tells the answer to this message from one that comes late, which is dropped. The loop limits
    the command to the range of the device, delays and holds it.

    Over a pipe the messages are on the stdin of the program and the answers on its stdout, which it flushes; its stderr
    is that of this process. Over UDP a message and an answer are a datagram each.
    """

    _made_by: ClassVar[str] = "law.protocol(building, devices)"

    message: tuple[ControllerNumbers, ...]
    answer: tuple[ControllerNumbers, ...]

    def _summary(self) -> Summary:
        sides = {"message": self.message, "answer": self.answer}
        return Summary(
            title="Protocol of a controller: little-endian doubles",
            facts=[
                (name, f"{numbers[-1].end} numbers, {NUMBER * numbers[-1].end} bytes")
                for name, numbers in sides.items()
            ],
            tables=[
                Table(
                    title=name,
                    columns=("place", "number", "unit", "of"),
                    rows=[
                        (
                            f"{each.first}" if len(each.of) < 2 else f"{each.first} to {each.end - 1}",
                            each.name,
                            each.unit,
                            list_names(each.of),
                        )
                        for each in numbers
                    ],
                )
                for name, numbers in sides.items()
            ],
            notes=(
                "Places count from 0. Sample 0 begins a run: the controller then forgets what it has kept.",
            ),
        )


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ProcessLaw(Summarised):
    """A control law outside Python: a program over a pipe, or a controller at a UDP port, asked at every sample.

    `mr.closed_loop.ControllerProtocol` says what it reads and writes. A program is started anew for each run, and its
    stdin ends with the run: then it shall end, and is otherwise killed. A controller at a UDP port is started by its
    user, and reset by sample 0 alone. Runs are simulated one after the other, so that no two share a memory.

    Where no answer comes in time, or one of another length, or a command that is not finite, and where a reading that
    is sent is not a number, all commands of the sample are zero, and the run ends as `failed_safe`. A controller that
    ends, or gives no answer to three messages in a row, is not asked again in this run. What the controller misses is
    counted in `round_trips`, and told in the remarks of the responses. The
    simulation waits for each answer, so it tests code and protocol of a controller, not whether it is fast enough for a
    rig.

    Raises
    ------
    SettingError
        If there is neither or both of a program and an address, or a number is out of range; in `simulate_loop` if the
        program does not start, or the first message has no answer of its form.

    Examples
    --------
    >>> import sys
    >>> import mrwork as mr
    >>> frame, rd1005 = mr.building("uts"), mr.damper("static_hysteretic").preset("kwok2006")
    >>> damper = mr.Device(
    ...     name="storey 1", spec=rd1005.spec, theta=rd1005.theta, row=frame.storeys[0], largest_command=1.88
    ... )
    >>> controller = '''
    ... import struct, sys
    ... while message := sys.stdin.buffer.read(8 * 5):
    ...     number, sample, time, missed, rate = struct.unpack("<5d", message)
    ...     sys.stdout.buffer.write(struct.pack("<2d", number, 10.0 * abs(rate)))
    ...     sys.stdout.buffer.flush()
    ... '''
    >>> law = mr.closed_loop.ProcessLaw(
    ...     name="proportional", program=[sys.executable, "-c", controller], readings=["rate"]
    ... )
    >>> mr.simulate_loop(frame, [damper], law, [mr.synthetic_motion(duration=0.1)]).shape
    (1, 1, 1)
    >>> law.round_trips.messages
    100
    """

    _made_by: ClassVar[str] = "mr.closed_loop.ProcessLaw(name=..., program=[...])"
    # A controller has one memory.
    most_at_once: ClassVar[int] = 1

    name: str = key("name in messages and tables", default="controller")
    program: tuple[str, ...] = key(
        "program and its arguments, each apart; no shell is started. In a study a program with a folder is relative to "
        "the study file",
        default=(),
        file=True,
    )
    address: tuple[str, Annotated[int, Within(least=1, most=65_535)]] | None = optional(
        "host and UDP port of a controller that runs already, instead of a program"
    )
    readings: tuple[Reading, ...] = key(
        "readings of a message, by default those of sensors; displacements, velocities and rates are true with "
        "feedback of the state, and estimates of the loop with an observer",
        default=("deformation", "force", "acceleration", "ground_acceleration", "drift"),
    )
    replaces_readings: bool = key(
        "whether the controller itself replaces readings that are not numbers, as a printed one does; otherwise a run "
        "has no command at a sample with one among its readings",
        default=False,
    )
    timeout: float = positive("longest time from a message to its answer", unit="s", default=1.0)
    start_timeout: float = positive(
        "the same for sample 0, in which a program starts", unit="s", default=10.0
    )
    _last: list[RoundTrips] = field(default_factory=list, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if bool(self.program) == (self.address is not None):
            both = "both a program and an address" if self.program else "neither a program nor an address"
            raise SettingError(f"{self.name} has {both}; give one of them")
        sent = tuple(reading for reading in READINGS if reading in self.readings)
        object.__setattr__(self, "readings", sent)

    @property
    def place(self) -> str:
        """Its program or its port, in words."""
        if self.address is not None:
            return "UDP port {}:{}".format(*self.address)
        return " ".join(" ".join(self.program).split())

    @property
    def source(self) -> str:
        """Digest by which a journal tells laws apart; a file among program and arguments counts by its content."""
        program = [
            sha256(path.read_bytes()).hexdigest() if (path := Path(which(name) or name)).is_file() else name
            for name in self.program
        ]
        settings = self.readings, self.replaces_readings, self.timeout, self.start_timeout
        return digest_of(program, self.address, *settings)

    @property
    def in_words(self) -> str:
        """Its name, and what it is."""
        return f"{self.name} outside Python"

    @property
    def round_trips(self) -> RoundTrips:
        """Round trips of the last simulation with this law.

        Raises
        ------
        SettingError
            If there was none.
        """
        if not self._last:
            raise SettingError(f"{self.name} has not run; simulate a loop with it first")
        return self._last[-1]

    @checked
    def protocol(
        self, building: Building, devices: Sequence[Device], hardware: Hardware | None = None
    ) -> ControllerProtocol:
        """The message and the answer in a loop with this building, devices and hardware."""
        names = tuple(device.name for device in commanded(devices))
        coordinates = tuple(f"coordinate {number}" for number in range(1, building.n_coordinates + 1))
        storeys = () if hardware is None else hardware.measured_storeys
        if unknown := [storey for storey in storeys if storey >= len(building.storey_names)]:
            raise SettingError(
                f"{building.name} has {len(building.storey_names)} storeys, counted from 0; {unknown} do not exist"
            )
        places = {
            **dict.fromkeys(("displacement", "velocity"), coordinates),
            **dict.fromkeys(("deformation", "rate", "force"), names),
            "acceleration": building.floor_names,
            "drift": tuple(building.storey_names[storey] for storey in storeys),
        }
        units, message, end = _HEAD | READINGS, [], 0
        for name in (*_HEAD, *self.readings):
            of = places.get(name, (name,))
            if of:
                of = of if name in places else ()
                message.append(ControllerNumbers(first=end, name=name, unit=units[name], of=of))
                end = message[-1].end
        answer = (
            ControllerNumbers(first=0, name="message", unit=""),
            ControllerNumbers(first=1, name="command", unit=command_unit_of(devices), of=names),
        )
        return ControllerProtocol(message=tuple(message), answer=answer)

    @checked
    def placeholder(self, devices: Sequence[Device]) -> ControlLaw:
        """The law that the core has in place of this one."""
        return ControlLaw(name="passive", gains={"command": np.zeros((1, len(devices)))})

    @checked
    @contextmanager
    def at_work(self, devices: Sequence[Device], sample_time: float) -> Iterator[AskOfRuns]:
        """The law as the core asks it, for one run after the other; at the end its program has ended."""
        session = _Session(self, len(devices), sample_time)
        try:
            yield session.ask_of
        finally:
            session.close()
            self._last[:] = [session.round_trips]

    def _summary(self) -> Summary:
        return Summary(
            title=f"Control law {self.name}, outside Python",
            facts=(
                ("controller", self.place),
                ("readings", ", ".join(self.readings)),
                ("timeout", f"{self.timeout:g} s, of sample 0 {self.start_timeout:g} s"),
            ),
            notes=(
                "The loop waits for it at every control sample: this tests code and protocol, not real time.",
            ),
        )


class _Session:
    """A simulation with a law outside Python: one run after the other, its link, and what is counted."""

    def __init__(self, law: ProcessLaw, n_devices: int, sample_time: float) -> None:
        self._law, self._n_devices, self._sample_time = law, n_devices, sample_time
        self._sent = [[*READINGS].index(reading) for reading in law.readings]
        self._answer = struct.Struct(f"<{1 + n_devices}d")
        self._no_command = np.full((1, n_devices), np.nan)
        self._link: Link | None = None
        self._answered = False
        self._runs = self._messages = 0
        self._before = 0 if law.address is None else session_number() << 32
        # Samples of this run without a command.
        self._missed = 0
        # Why a sample has none, and the same of the last ones in a row, by which the controller may be lost.
        self._failures, self._in_a_row = Counter[str](), Counter[str]()
        self._lost: dict[int, LostController] = {}
        self._seconds = array("d")

    @property
    def round_trips(self) -> RoundTrips:
        """What was counted."""
        return RoundTrips(
            name=self._law.name,
            sample_time=self._sample_time,
            seconds=np.array(self._seconds),
            runs=self._runs,
            messages=self._messages,
            **{name: (self._failures + self._in_a_row)[name] for name in _FAILURES},
            lost=tuple(self._lost.values()),
        )

    def ask_of(self, _: NDArray[np.uint32]) -> Ask:
        """The law for the next run."""
        self._runs += 1
        return self._ask

    def close(self) -> None:
        """End the link, if there is one."""
        link, self._link = self._link, None
        if link is not None:
            link.close()

    def _begin(self) -> None:
        """Begin a run; one that the loop repeats with a shorter step is another one for the controller, too."""
        self.close()
        self._missed = 0
        self._failures += self._in_a_row
        self._in_a_row.clear()
        self._lost.pop(self._runs, None)
        law, size = self._law, self._answer.size
        self._link = (
            Pipe(law.program, size) if law.address is None else UdpPort(law.address, size, law.start_timeout)
        )

    def _ask(self, number: int, _: NDArray[np.uintp], *given: Any) -> Floats:
        """Commands of a sample, shape (1, n_devices); not a number where the controller gives none."""
        *measured, are_numbers = given
        commands = self._answer_to(number, measured)
        if are_numbers or self._law.replaces_readings:
            return commands
        unknown = any(np.isnan(measured[place]).any() for place in self._sent)
        return self._no_command if unknown else commands

    def _answer_to(self, number: int, measured: Sequence[Floats]) -> Floats:
        if number == 0:
            self._begin()
        link = self._link
        if link is None:
            return self._no_command
        self._messages += 1
        head = self._before + self._messages, number, number * self._sample_time, self._missed
        readings = (measured[place].ravel() for place in self._sent)
        message = np.concatenate([head, *readings]).astype("<f8", copy=False).tobytes()
        began = perf_counter()
        try:
            answer = link.exchange(
                message,
                self._law.timeout if number else self._law.start_timeout,
                is_first=not self._answered,
            )
        except LinkEndedError as ended:
            if not self._answered:
                raise SettingError(
                    f"{self._law.name} {ended} before its first answer; {link.look}, and let it answer each message "
                    f"until {link.until}"
                ) from None
            self._lose(link, number, str(ended))
            return self._no_command
        took = perf_counter() - began
        if len(answer) != self._answer.size:
            if not self._answered:
                raise SettingError(self._no_first_answer(link, len(message), answer))
            self._missed += 1
            self._in_a_row["misshapen" if answer else "unanswered"] += 1
            # Where a run begins without an answer, or has several in a row, its controller is lost.
            if number == 0 or self._in_a_row.total() == _HANGS:
                messages = f"{_HANGS} messages in a row" if number else "sample 0"
                self._lose(
                    link, number + 1, f"gave no answer of {self._answer.size} bytes in time to {messages}"
                )
            return self._no_command
        self._answered = True
        self._failures += self._in_a_row
        self._in_a_row.clear()
        if number:
            self._seconds.append(took)
        commands = np.array([self._answer.unpack(answer)[1:]])
        if np.isfinite(commands).all():
            return commands
        self._missed += 1
        self._failures["not_finite"] += 1
        return self._no_command

    def _no_first_answer(self, link: Link, asked: int, answer: bytes) -> str:
        """Why the first message has no answer, as far as it can be told."""
        name, size = self._law.name, self._answer.size
        form = f"{size} bytes, the number of the message and then {counted(self._n_devices, 'command')}"
        if text := _text_of(link.strayed or answer):
            text = repr(text[:40])
            return f"{name} wrote the text {text} on stdout; let it write text to stderr, and as its answer {form}"
        if answer:
            return f"{name} answered sample 0 with {len(answer)} bytes; let it write {form}"
        if link.strayed:
            (first,) = struct.unpack_from("<d", link.strayed)
            asked_first = self._before + self._messages
            return (
                f"{name} answered sample 0 with {first:g} as its first number, where the message had {asked_first}; "
                f"let it write {form}, as little-endian doubles"
            )
        return (
            f"{name} gave no answer to sample 0 within {self._law.start_timeout:g} s; let it read {asked} bytes and "
            f"then write {form}, without a buffer that waits for more"
        )

    def _lose(self, link: Link, number: int, ended: str) -> None:
        """Go on with this run without the controller, which has answered until the misses in a row before a sample."""
        first = number - self._in_a_row.total()
        self._lost[self._runs] = LostController(
            run=self._runs - 1, time=first * self._sample_time, ended=ended, look=link.look
        )
        self._in_a_row.clear()
        self.close()


def _text_of(answer: bytes) -> str:
    """The text that an answer is, empty where it is none: numbers have bytes that no text has."""
    try:
        text = answer.decode()
    except UnicodeDecodeError:
        return ""
    return text.strip() if all(letter.isprintable() or letter.isspace() for letter in text) else ""
