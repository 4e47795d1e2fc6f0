"""A controller outside Python has the commands of the registry; one that fails gives zero and is told."""

import os
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from command_line import PATIENCE
from loop_samples import devices, five_storeys, friction, law_with_gains, plant_with, rd1005, still, sweep
from outside_controllers import CONTROLLER, RIGHT, build, compiled
from refusals import refusal

import mrwork as mr
from mrwork.closed_loop import Fault, Hardware, LoopSample, ProcessLaw, Responses, UserLaw
from mrwork.closed_loop.loop_sample import READINGS
from mrwork.closed_loop.process_law import Reading
from mrwork.dampers.simulation import Outcome

SAMPLES = Path(__file__).parents[1] / "samples"
WITH_OBSERVER = Hardware(
    feedback="observer",
    measured_floors=(1, 4),
    measured_storeys=(0, 2),
    known_ground=True,
    acceleration_noise=0.01,
    force_noise=1.0,
    delay=2e-3,
    faults=(Fault(channel="acceleration", index=4, start=0.1, end=0.2, value=np.nan),),
)
HARDWARE = {"state": Hardware(), "observer": WITH_OBSERVER}
OF_STATE = ("displacement", "velocity", "force")


@contextmanager
def linked(program: Path, link: str, readings: tuple[str, ...]) -> Iterator[ProcessLaw]:
    """The law over a pipe, or at a UDP port of a controller that is started here."""
    if link == "pipe":
        yield ProcessLaw(name="outside", program=[str(program)], readings=readings, replaces_readings=True)
        return
    with subprocess.Popen([program, "udp"], stdout=subprocess.PIPE) as process:
        port = int(process.stdout.readline())
        address = ("localhost", port)
        yield ProcessLaw(name="outside", address=address, readings=readings, replaces_readings=True)
        assert process.poll() is None
        process.kill()


def readings_for(hardware: Hardware) -> tuple[str, ...]:
    if hardware.feedback == "state":
        return OF_STATE
    return ProcessLaw(name="default", program=["x"]).readings


def same_commands(ours: Responses, theirs: Responses) -> None:
    """Equal bits in every sample of every run, with commands that are not zero throughout."""
    assert len(ours.histories) == len(theirs.histories)
    for one, other in zip(ours.histories, theirs.histories, strict=True):
        assert one.command.max() > 0.0
        for signal_name in ("command", "force", "state"):
            np.testing.assert_array_equal(getattr(one, signal_name), getattr(other, signal_name))


@compiled
@pytest.mark.parametrize("link", ["pipe", "udp"])
@pytest.mark.parametrize("hardware", HARDWARE.values(), ids=HARDWARE)
@pytest.mark.parametrize("name", ["clipped_optimal", "modified_clipped_optimal"])
def test_a_controller_in_c_has_the_commands_of_the_registry(
    tmp_path: Path, name: str, hardware: Hardware, link: str
) -> None:
    frame, loop = five_storeys(), devices(rd1005(), second=True)
    law = law_with_gains(name, plant_with(loop))
    program = build(tmp_path, frame, loop, law, hardware)
    motions = [sweep(0.5), sweep(0.7)]
    registry = mr.simulate_loop(frame, loop, law, motions, hardware, histories=True)
    with linked(program, link, readings_for(hardware)) as outside:
        found = mr.simulate_loop(frame, loop, outside, motions, hardware, histories=True)
    same_commands(registry, found)
    assert set(found.outcome) == {Outcome.FINISHED}
    assert found.law_remarks == ()
    trips = outside.round_trips
    assert (trips.messages, trips.runs, len(trips.seconds), trips.lost) == (1200, 2, 1198, ())
    assert 0.0 < trips.median <= trips.slow <= trips.largest


@cache
def python_law(text: str, **settings: float) -> ProcessLaw:
    """A controller in Python of the rate, with `text` for each message."""
    program = [sys.executable, "-S", "-c", CONTROLLER + text]
    return ProcessLaw(name="in Python", program=program, readings=["rate"], **settings)


def run(law: ProcessLaw | UserLaw, *motions: mr.GroundMotion, **settings: object) -> Responses:
    pair = devices(rd1005(), second=False)
    return mr.simulate_loop(five_storeys(), pair, law, motions or [sweep(0.05)], histories=True, **settings)


def proportional(sample: LoopSample, memory: np.ndarray) -> np.ndarray:
    return 10.0 * np.abs(sample.rate)


def children() -> set[str]:
    """Processes that this one has started, alive or not waited for; none where the system does not list them."""
    found = set()
    for status in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            # The name of the program, in brackets, may have blanks.
            if int(status.read_text().rpartition(")")[2].split()[1]) == os.getpid():
                found.add(status.parent.name)
    return found


@pytest.fixture(autouse=True)
def _no_process_is_left() -> Iterator[None]:
    before = children()
    yield
    assert children() <= before


def test_readings_are_those_of_a_sample_in_its_order() -> None:
    entries = [entry.name for entry in fields(LoopSample)]
    assert get_args(Reading) == tuple(READINGS)
    assert [entry for entry in entries if entry in READINGS] == [*READINGS]
    assert {*entries} - {*READINGS} == {"time", "sample_time", "candidate", "motion", "largest", "rms"}


def test_the_protocol_says_what_is_sent(tmp_path: Path) -> None:
    """A program that keeps its first message has the numbers of the protocol, in its order."""
    kept = tmp_path / "first"
    readings = [*READINGS][::-1]
    hardware = Hardware(measured_storeys=(2, 0))
    loop = devices(rd1005(), second=True)
    law = ProcessLaw(name="keeps", program=["x"], readings=readings)
    assert law.readings == tuple(READINGS)
    protocol = law.protocol(five_storeys(), loop, hardware)
    count = protocol.message[-1].end
    text = CONTROLLER.replace("numbers(5)", f"(*(all := numbers({count}))[:4], 0.0)")
    text += f"    if sample == 40.0: open({str(kept)!r}, 'wb').write(struct.pack('<{count}d', *all))\n"
    text += "    write(message, 0.5, 1.0)"
    law = ProcessLaw(name="keeps", program=[sys.executable, "-S", "-c", text], readings=readings)
    seen: list[LoopSample] = []

    def looked(sample: LoopSample, memory: np.ndarray) -> np.ndarray:
        seen.append(sample)
        return np.array([[0.5, 1.0]])

    for each in (law, UserLaw(name="looks", command=looked)):
        mr.simulate_loop(five_storeys(), loop, each, [sweep(0.1)], hardware)
    sent = dict(
        zip(("message", "sample", "time", "missed"), np.frombuffer(kept.read_bytes(), "<f8")[:4], strict=True)
    )
    assert sent == {"message": 41.0, "sample": 40.0, "time": 0.04, "missed": 0.0}
    for numbers in protocol.message[4:]:
        there = np.frombuffer(kept.read_bytes(), "<f8")[numbers.first : numbers.end]
        np.testing.assert_array_equal(there, np.ravel(getattr(seen[40], numbers.name)), err_msg=numbers.name)
        assert np.any(there), numbers.name
    refusal(
        law.protocol,
        five_storeys(),
        loop,
        Hardware(measured_storeys=(5,)),
        match="has 5 storeys, .* do not exist",
    )
    (drift,) = (numbers for numbers in protocol.message if numbers.name == "drift")
    assert (drift.of, drift.unit) == (("storey 3", "storey 1"), "m")
    assert [(each.name, each.first, each.of) for each in protocol.answer] == [
        ("message", 0, ()),
        ("command", 1, ("pair", "two")),
    ]
    assert all(numbers.name in str(protocol) for numbers in protocol.message)


def test_a_law_in_python_over_a_pipe_has_its_own_commands() -> None:
    motions = [sweep(0.2), sweep(0.3)]
    ours, theirs = (
        run(UserLaw(name="inside", command=proportional), *motions),
        run(python_law(RIGHT), *motions),
    )
    same_commands(ours, theirs)


@pytest.mark.parametrize("replaces", [False, True])
def test_a_reading_that_is_no_number_is_no_command_of_a_controller_that_does_not_replace_it(
    replaces: bool,
) -> None:
    broken = Fault(channel="deformation", index=0, start=0.02, end=0.03, value=np.nan)
    text = CONTROLLER + "    write(message, 1.5)"
    program = [sys.executable, "-S", "-c", text]
    law = ProcessLaw(name="on", program=program, readings=["deformation"], replaces_readings=replaces)
    found = run(law, hardware=Hardware(faults=(broken,)))
    (history,) = found.histories
    during = (history.time > 0.021) & (history.time < 0.029)
    assert set(history.command[during, 0]) == {1.5 if replaces else 0.0}
    assert set(found.outcome) == {Outcome.FINISHED if replaces else Outcome.FAILED_SAFE}


def test_each_run_has_a_memory_of_its_own() -> None:
    """A controller that does not look at the number of the sample counts from 1 in each run, also in a repeated one."""
    law = python_law("    write(message, 1e-3 * kept)")
    for model in (rd1005(), friction()):
        pair = devices(model, second=False)
        found = mr.simulate_loop(five_storeys(), pair, law, [still(0.1), still(0.1)], histories=True)
        for history in found.histories:
            ramp = 1e-3 * np.arange(1, len(history.time))
            np.testing.assert_allclose(history.command[:, 0], [*ramp, ramp[-1]])


MISSES = {
    "ends": ("    if sample == 20: sys.exit(3)\n", "ended with status 3 at 0.02 s of run 1 of 1"),
    "is killed": (
        "    if sample == 20: import os; os.kill(os.getpid(), 9)\n",
        r"ended by signal 9 \(Killed\) at 0.02 s",
    ),
    "hangs": ("    if sample == 20: time.sleep(60.0)\n", "3 messages in a row at 0.02 s"),
    "writes too much": (
        "    if sample > 19: write(1.5); time.sleep(0.02)\n",
        "no answer of 16 bytes in time to 3 messages in a row at 0.02 s",
    ),
    "closes its stdout": (
        "    if sample == 20: import os; os.close(1); time.sleep(60.0)\n",
        "closed its stdin or stdout at 0.02 s",
    ),
}


@pytest.mark.parametrize(("fails", "words"), MISSES.values(), ids=MISSES)
def test_a_controller_that_is_lost_gives_zero_from_there_on(fails: str, words: str) -> None:
    law = python_law(fails + RIGHT, timeout=0.1)
    found, right = run(law), run(UserLaw(name="inside", command=proportional))
    command = found.histories[0].command[:, 0]
    np.testing.assert_array_equal(command[:20], right.histories[0].command[:20, 0])
    assert command[:20].max() > 0.0
    np.testing.assert_array_equal(command[20:], 0.0)
    assert set(found.outcome) == {Outcome.FAILED_SAFE}
    (remark,) = found.law_remarks
    assert (remark.code, remark.severity) == ("controller_lost", "warning")
    assert re.search(words, remark.message), remark.message


def test_a_controller_that_leaves_its_port_has_no_stderr_to_look_at() -> None:
    with socket.socket(type=socket.SOCK_DGRAM) as port:
        port.bind(("127.0.0.1", 0))

        def answer() -> None:
            for _ in range(20):
                message, place = port.recvfrom(1 << 12)
                port.sendto(message[:8] + struct.pack("<d", 1.0), place)
            port.close()

        controller = threading.Thread(target=answer)
        controller.start()
        found = run(ProcessLaw(name="mine", address=port.getsockname(), readings=["rate"], timeout=0.1))
        controller.join()
    (remark,) = found.law_remarks
    assert remark.code == "controller_lost"
    assert "listens at that port" in remark.message
    assert "stderr" not in remark.message


def test_a_controller_is_started_again_for_the_next_run(tmp_path: Path) -> None:
    """One that ends in its second run is there in the third."""
    marks = tmp_path / "runs"
    text = f"""    if sample == 0:
        with open({str(marks)!r}, 'a') as file: file.write('x')
        number = len(open({str(marks)!r}).read())
    if number == 2 and sample == 30: sys.exit(0)
"""
    law = python_law(text + RIGHT)
    motions = [sweep(0.05)] * 3
    found, right = run(law, *motions), run(UserLaw(name="inside", command=proportional), *motions)
    assert [Outcome(each) for each in found.outcome] == [
        Outcome.FINISHED,
        Outcome.FAILED_SAFE,
        Outcome.FINISHED,
    ]
    for number in (0, 2):
        np.testing.assert_array_equal(found.histories[number].command, right.histories[number].command)
    (lost,) = law.round_trips.lost
    assert (lost.run, round(lost.time, 6)) == (1, 0.03)
    assert "run 2 of 3" in found.law_remarks[0].message


WITHOUT = {
    "not_finite": ("    write(message, float('nan') if sample in (7, 9) else 10.0 * abs(rate))", 2, (7, 9)),
    "not_finite of infinity": (
        "    write(message, float('inf') if sample == 7 else 10.0 * abs(rate))",
        1,
        (7,),
    ),
    "misshapen": ("    write(*((message,) if sample == 7 else (message, 10.0 * abs(rate))))", 1, (7,)),
    "misshapen, too long": ("    write(message, *([10.0 * abs(rate)] * (2 if sample == 7 else 1)))", 1, (7,)),
    "unanswered": ("    if sample != 7: write(message, 10.0 * abs(rate))", 1, (7,)),
    "unanswered, but late": (
        "    if sample == 7: time.sleep(0.3)\n    write(message, 10.0 * abs(rate) if sample != 7 else 1.5)",
        1,
        (7,),
    ),
}


@pytest.mark.parametrize(("name", "case"), WITHOUT.items(), ids=WITHOUT)
def test_a_sample_without_a_command_is_zero_and_counted(
    name: str, case: tuple[str, int, tuple[int, ...]]
) -> None:
    text, count, samples = case
    law = python_law(text, timeout=0.2)
    found = run(law)
    command = found.histories[0].command[:, 0]
    # At the first sample the rate is zero.
    assert [*np.flatnonzero(command[1:-1] == 0.0) + 1] == [*samples]
    assert command.max() < 1.5
    trips = law.round_trips
    counts = {each: getattr(trips, each) for each in ("unanswered", "misshapen", "not_finite")}
    assert counts == {**dict.fromkeys(counts, 0), name.split(",")[0].split()[0]: count}
    assert trips.lost == ()
    (remark,) = found.law_remarks
    assert remark.code == "controller_without_answer"
    assert f"no command in {count} of 50 samples" in remark.message
    assert set(found.outcome) == {Outcome.FAILED_SAFE}
    assert remark.message in " ".join(str(trips).split())


def test_a_controller_is_told_what_it_missed() -> None:
    law = python_law("    write(message, float('nan') if sample in (7, 9) else 1e-3 * (1.0 + missed))")
    command = run(law).histories[0].command[:, 0]
    assert set(command) == {1e-3, 0.0, 2e-3, 3e-3}


FIRST = {
    "no such program": (["./no_such_program"], "no_such_program does not start: .*No such file"),
    "no program at all": ([str(SAMPLES)], "does not start: .*Permission denied"),
    "ends at once": (
        [sys.executable, "-c", "raise SystemExit(4)"],
        "ended with status 4 before its first answer",
    ),
    "never answers": (
        [sys.executable, "-S", "-c", "import time; time.sleep(60.0)"],
        r"no answer to sample 0 within 1 s; let it read 40 bytes and then write 16 bytes",
    ),
}


@pytest.mark.parametrize(("program", "words"), FIRST.values(), ids=FIRST)
def test_a_controller_that_does_not_begin_is_refused(program: list[str], words: str) -> None:
    law = ProcessLaw(name="mine", program=program, readings=["rate"], start_timeout=1.0)
    refusal(run, law, match=words)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "    write(abs(rate))",
            "answered sample 0 with 8 bytes; let it write 16 bytes, the number of the message",
        ),
        ("    write(sample, abs(rate))", "with 0 as its first number, where the message had 1"),
        ("    write(message, 1.0, 2.0)", "answered sample 0 with 24 bytes"),
    ],
)
def test_a_first_answer_of_another_form_is_refused(text: str, words: str) -> None:
    refusal(run, python_law(text, start_timeout=1.0), match=words)


FLOODS = {
    "text": (["yes"], r"wrote the text 'y\\ny\\n.*' on stdout; let it write text to stderr"),
    "zeros": (["cat", "/dev/zero"], "with 0 as its first number, where the message had 1"),
    "a line": (["sh", "-c", "echo ready; cat >/dev/null"], "wrote the text 'ready' on stdout"),
}


@pytest.mark.parametrize(("program", "words"), FLOODS.values(), ids=FLOODS)
def test_what_is_no_answer_to_the_first_message_is_refused_at_once(program: list[str], words: str) -> None:
    began = time.monotonic()
    refusal(run, ProcessLaw(name="mine", program=program, readings=["rate"], start_timeout=60.0), match=words)
    assert time.monotonic() - began < 30.0


def test_a_controller_that_writes_without_end_is_waited_for_as_long_as_any(tmp_path: Path) -> None:
    text = "    write(message if sample < 5 else -1.0, 1.0)\n    while sample == 5: write(-1.0, 1.0)"
    law = python_law(text, timeout=0.2)
    found = run(law)
    assert law.round_trips.lost[0].time == pytest.approx(0.005)
    assert np.all(found.histories[0].command[6:] == 0.0)


def test_what_a_program_has_started_ends_with_it_also_where_python_is_killed(tmp_path: Path) -> None:
    pid = tmp_path / "pid"
    start = (
        "import subprocess\nchild = subprocess.Popen(['sleep', '600'])\n"
        f"open({str(pid)!r}, 'w').write(str(child.pid))\n"
    )
    text = start + CONTROLLER + "    write(message, 1.0)"
    law = ProcessLaw(name="mine", program=[sys.executable, "-S", "-c", text], readings=["rate"])
    run(law)
    # A signal takes its time.
    wait_until(lambda: not is_alive(int(pid.read_text())))
    pid.unlink()
    script = (
        "import sys, time\nfrom mrwork.closed_loop.controller_link import Pipe\n"
        f"link = Pipe([sys.executable, '-S', '-c', {(start + 'import time; time.sleep(600)')!r}], 16)\ntime.sleep(600)"
    )
    with subprocess.Popen([sys.executable, "-c", script]) as process:
        wait_until(lambda: pid.exists() and pid.read_text())
        process.kill()
    wait_until(lambda: not is_alive(int(pid.read_text())))


def is_alive(pid: int) -> bool:
    """Whether a process runs; one that nobody waited for does not."""
    with suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


def wait_until(happened: Callable[[], object]) -> None:
    until = time.monotonic() + PATIENCE
    while not happened():
        assert time.monotonic() < until
        time.sleep(0.02)


def test_two_loops_at_one_port_are_told_apart() -> None:
    """A controller with a memory: its commands are those of one loop after the other, and each has a session."""
    sessions = set()

    def answer(port: socket.socket) -> None:
        level = 0.0
        with suppress(OSError):
            while True:
                message, place = port.recvfrom(1 << 12)
                number, sample, *_, rate = struct.unpack("<5d", message)
                sessions.add(number // 2.0**32)
                level = 0.99 * (level if sample else 0.0) + 0.1 * abs(rate)
                port.sendto(struct.pack("<2d", number, min(1.5, level)), place)

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port:
        port.bind(("127.0.0.1", 0))
        server = threading.Thread(target=answer, args=(port,), daemon=True)
        server.start()
        address = port.getsockname()

        def command(duration: float, found: dict[float, np.ndarray]) -> None:
            law = ProcessLaw(name="board", address=address, readings=["rate"])
            found[duration] = run(law, sweep(duration)).histories[0].command

        alone: dict[float, np.ndarray] = {}
        together: dict[float, np.ndarray] = {}
        for duration in (0.3, 0.4):
            command(duration, alone)
        loops = [threading.Thread(target=command, args=(duration, together)) for duration in alone]
        for loop in loops:
            loop.start()
        for loop in loops:
            loop.join()
        for duration, right in alone.items():
            np.testing.assert_array_equal(together[duration], right)
        assert len(sessions) == 4
        assert min(sessions) >= 1.0


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({}, "neither a program nor an address"),
        ({"program": ["x"], "address": ("localhost", 4000)}, "both a program and an address"),
        ({"program": ["x"], "readings": ["accelerations"]}, "acceleration"),
        ({"program": "./controller"}, "program"),
        ({"address": ("localhost", 0)}, "address"),
    ],
)
def test_a_law_of_no_controller_is_refused(settings: dict[str, object], words: str) -> None:
    refusal(ProcessLaw, name="mine", match=words, **settings)


def test_a_port_where_nothing_listens_is_refused() -> None:
    law = ProcessLaw(name="mine", address=("127.0.0.1", 9), start_timeout=1.0)
    refused = refusal(run, law, match=r"127\.0\.0\.1:9 .*see whether it runs and listens at that port")
    assert "std" not in str(refused)
    nowhere = ProcessLaw(name="mine", address=("no-such-host.invalid", 4000))
    refusal(run, nowhere, match="no way to no-such-host.invalid:4000")


def test_round_trips_of_a_law_that_has_not_run_are_refused() -> None:
    refusal(lambda: ProcessLaw(name="mine", program=["x"]).round_trips, match="has not run")


def test_an_error_ends_the_program() -> None:
    def stop(done: int, total: int) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        run(python_law(RIGHT), sweep(0.05), sweep(0.05), on_progress=stop)


def test_a_program_that_hangs_is_killed_with_what_it_has_started(tmp_path: Path) -> None:
    mark = tmp_path / "pid"
    text = f"""    if sample == 5:
        import subprocess
        open({str(mark)!r}, 'w').write(str(subprocess.Popen(['sleep', '600']).pid))
        time.sleep(60.0)
"""
    run(python_law(text + RIGHT, timeout=0.1))
    process, until = Path(f"/proc/{mark.read_text()}/stat"), time.monotonic() + PATIENCE
    # It takes a moment to end, and nobody may wait for it.
    while process.exists() and process.read_text().split()[2] != "Z":
        assert time.monotonic() < until
        time.sleep(0.01)


INTERRUPTED = """
import sys
import threading
sys.path[:0] = {path!r}
from test_process_law import python_law, run, sweep
run(python_law({text!r}), sweep(60.0))
"""


@pytest.mark.machine
def test_ctrl_c_ends_the_program(tmp_path: Path) -> None:
    mark = tmp_path / "pid"
    text = f"    if sample == 20: import os; open({str(mark)!r}, 'w').write(str(os.getpid())); time.sleep(60.0)\n"
    path = [str(Path(__file__).parent), str(SAMPLES), *sys.path]
    script = INTERRUPTED.format(path=path, text=text + RIGHT)
    with subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.PIPE, text=True) as process:
        until = time.monotonic() + PATIENCE
        while not (mark.exists() and mark.read_text()) and time.monotonic() < until:
            time.sleep(0.05)
        os.kill(process.pid, signal.SIGINT)
        _, said = process.communicate(timeout=PATIENCE)
    assert "KeyboardInterrupt" in said
    with pytest.raises(ProcessLookupError):
        os.kill(int(mark.read_text()), 0)


@compiled
def test_the_program_of_the_guide_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    page = (SAMPLES.parents[1] / "docs" / "guides" / "outside_controller.md").read_text(encoding="utf-8")
    (tmp_path / "controller.c").write_text(page.partition("```c\n")[2].partition("```")[0])
    (line,) = (line for line in page.splitlines() if line.startswith("    cc "))
    subprocess.run([*line.split(), "-Wall", "-Wextra", "-Werror", "-pedantic"], check=True)
    names: dict[str, object] = {}
    for block in page.split("```python\n")[1:]:
        exec(block.partition("```")[0].replace("duration=10.0", "duration=0.5"), names)
    responses = names["responses"]
    assert isinstance(responses, Responses)
    assert set(responses.outcome) == {Outcome.FINISHED}
    assert responses.peak_current.min() > 0.0
