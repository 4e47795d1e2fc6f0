"""What ends a command that cannot go on: one sentence and its exit status, whatever stdout, stderr or a signal does."""

from __future__ import annotations

import errno
import io
import json
import logging
import os
import signal
import subprocess
import sys
import warnings
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np
import pytest
from command_line import COMMAND, PATIENCE, mrwork, printed, ran
from study_texts import study_text

from mrwork.cli.door import sentence_on, warnings_in_one_line
from mrwork.cli.output import print_json
from mrwork.cli.terminal import note, show
from mrwork.errors import RecordError

ROOT = Path(sys.modules["mrwork"].__file__ or "").parent


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "/a/file"), "/a/file: No space left on device"),
        (OSError(), "a file could not be read or written"),
        (MemoryError(), "not enough memory"),
        (RecursionError("maximum recursion depth exceeded"), "nested too deeply"),
        (OverflowError("int too big to convert"), "int too big to convert"),
        (UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte"), "UTF-8"),
        (ImportError("libfoo.so: cannot open shared object file"), "libfoo.so"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_the_machine_cannot_do_is_a_sentence_that_says_what_to_do(error: Exception, words: str) -> None:
    sentence = sentence_on(error)
    assert words in sentence
    assert ";" in sentence
    assert "\n" not in sentence


class MuteError(Exception):
    """An error of a library whose text cannot be made."""

    def __str__(self) -> str:
        raise ValueError("no text")


@pytest.mark.parametrize("kind", [OSError, OverflowError, UnicodeError, ImportError, RecordError])
def test_an_error_whose_text_raises_is_a_sentence(kind: type[Exception]) -> None:
    mute = type("Mute", (kind,), {"__str__": MuteError.__str__})
    for error in (kind(MuteError()), mute("a text")):
        assert "a text that cannot be shown" in sentence_on(error)


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"[" * 200_000, "manifest"), (b'{"kind": "\xff"}', "manifest"), (None, "manifest")],
)
def test_a_manifest_that_is_none_is_one_sentence(tmp_path: Path, content: bytes | None, words: str) -> None:
    manifest = tmp_path / "manifest.json"
    manifest.mkdir() if content is None else manifest.write_bytes(content)
    ended = mrwork("report", tmp_path)
    assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (2, "", 1), ended.stderr


# Streams


def in_a_shell(line: str) -> subprocess.CompletedProcess[str]:
    return ran("bash", "-c", line, "bash", *COMMAND)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('"$@" models > /dev/full', "No space left"),
        ('"$@" --help > /dev/full', "No space left"),
        ('"$@" models >&-', "standard output is closed"),
    ],
)
def test_a_full_or_closed_stdout_is_one_sentence(line: str, words: str) -> None:
    ended = in_a_shell(line)
    assert ended.returncode == 2, ended
    assert words in ended.stderr
    assert len(ended.stderr.splitlines()) == 1


def test_a_reader_that_leaves_is_no_error() -> None:
    with subprocess.Popen(
        [*COMMAND, "models", "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        said = process.stderr.read()
    assert process.returncode == 0
    assert said == ""


def test_what_is_to_be_written_is_written_without_a_reader(tmp_path: Path) -> None:
    sizes = "--every 20 --quiet --out"
    ended = in_a_shell(
        f'"$@" identify synthetic:rd1005_1a --model bingham {sizes} {tmp_path}/run | true; echo ${{PIPESTATUS[0]}}'
    )
    assert (ended.stdout, ended.stderr) == ("0\n", "")
    assert "<svg" in (tmp_path / "run" / "report.html").read_text()


@pytest.mark.parametrize("stderr", ["2>&-", "2>/dev/full"])
def test_without_stderr_the_status_and_stdout_stay(stderr: str) -> None:
    refused = in_a_shell(f'"$@" models none {stderr}')
    assert (refused.returncode, refused.stdout) == (2, "")
    done = in_a_shell(f'"$@" models bingham --json {stderr}')
    assert done.returncode == 0
    assert json.loads(done.stdout)["name"] == "bingham"


def test_ascii_terminals_show_what_they_can() -> None:
    ended = subprocess.run(
        [*COMMAND, "models", "no\udcff\u00b5"],
        capture_output=True,
        env=os.environ | {"PYTHONIOENCODING": "ascii:strict"},
        check=False,
        timeout=PATIENCE,
    )
    assert ended.returncode == 2
    assert b"Traceback" not in ended.stderr
    assert rb"\udcff" in ended.stderr


# Libraries

STUDY = study_text("control_weight = 1e-13").replace("duration = 2", "duration = 0.3")
STUDIES = {
    "clairvoyant": f"{STUDY}[clairvoyant]\nrandom_starts = 0\n",
    "gradients": STUDY.replace("duration = 0.3", "duration = 0.3\nuse = 'training'")
    + "[[motion]]\nsynthetic = 'kanai_tajimi'\nduration = 0.3\nseed = 1\nname = 'other'\n"
    "[[tune]]\nlaws = ['proportional_direct']\nbudget = 6\npopulation = 5\ngradient_steps = 1\n",
}
OPTIMISTIX = ("--model", "bingham", "--engine", "optimistix", "--every", "20", "--generations", "2")


@pytest.mark.parametrize(
    "words",
    [
        ("identify", "synthetic:spencer1997", *OPTIMISTIX),
        ("respond", "clairvoyant.toml"),
    ],
    ids=lambda words: words[0],
)
def test_jax_that_does_not_start_is_one_sentence_and_what_was_computed_is_kept(
    tmp_path: Path, words: tuple[str, ...]
) -> None:
    for name, text in STUDIES.items():
        (tmp_path / f"{name}.toml").write_text(text)
    ended = ran(
        *(*COMMAND, *words, "--quiet", "--threads", "1", "--out", "run"),
        env=os.environ | {"JAX_PLATFORMS": "nope"},
        cwd=tmp_path,
    )
    assert (ended.returncode, ended.stdout) == (2, ""), ended.stderr
    assert "unset JAX_PLATFORMS" in ended.stderr
    assert len(ended.stderr.splitlines()) == 1
    assert (tmp_path / "run.part" / "journal.jsonl").is_file()


@pytest.mark.parametrize(
    ("variable", "words", "status", "remedy"),
    [
        (
            "JAX_ENABLE_X64",
            ("identify", "synthetic:spencer1997", *OPTIMISTIX),
            2,
            "unset the environment variable",
        ),
        # The results stand, and the page is not drawn.
        ("MPLBACKEND", ("respond", "study.toml"), 0, "mrwork report run draws it"),
    ],
    ids=["JAX", "Matplotlib"],
)
def test_a_wrong_value_of_a_librarys_variable_is_one_sentence(
    tmp_path: Path, variable: str, words: tuple[str, ...], status: int, remedy: str
) -> None:
    (tmp_path / "study.toml").write_text(STUDY)
    ended = ran(
        *COMMAND, *words, "--quiet", "--out", "run", env=os.environ | {variable: "banana"}, cwd=tmp_path
    )
    assert ended.returncode == status, ended.stderr
    assert len(ended.stderr.splitlines()) == 1
    assert "'banana'" in ended.stderr
    assert remedy in ended.stderr


# StopSignals

# The signal comes from the process itself, at one of its imports: a point that no load of the machine moves.
SIGNALLED = """
import os, signal, sys
from mrwork.cli import main

number, point, module = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
del sys.argv[1:4]
imports = 0

def send(event, arguments):
    global imports
    if event == "import" and arguments[0].startswith(module):
        imports += 1
        if imports == point:
            os.kill(os.getpid(), number)

sys.addaudithook(send)
try:
    main()
finally:
    print(imports, file=sys.stderr)
"""


def signalled(
    number: int, point: int, *arguments: object, module: str = ""
) -> subprocess.CompletedProcess[str]:
    """A command line with a signal at its import of that number, among those of a module."""
    return ran(sys.executable, "-c", SIGNALLED, str(int(number)), point, module, *arguments)


@pytest.fixture(scope="module")
def imports() -> int:
    """How many imports the command of the tests below makes."""
    ended = signalled(signal.SIGINT, 0, "check", "synthetic:spencer1997")
    assert ended.returncode == 0, ended.stderr
    return int(ended.stderr.splitlines()[-1])


@pytest.mark.parametrize(
    ("number", "sixth"),
    [*((signal.SIGINT, point) for point in range(6)), *((signal.SIGTERM, point) for point in (0, 3))],
)
def test_a_signal_while_modules_are_loaded_is_no_traceback(
    number: signal.StopSignals, sixth: int, imports: int
) -> None:
    point = 1 + sixth * (imports - 1) // 6
    ended = signalled(number, point, "check", "synthetic:spencer1997")
    assert ended.returncode == 128 + number, ended.stderr
    assert ended.stderr == "mrwork: interrupted\n"
    assert ended.stdout == ""


def test_before_signals_are_answered_next_to_nothing_is_loaded() -> None:
    loaded = "import sys; import mrwork.cli; print(sorted(name for name in sys.modules if 'mrwork' in name))"
    ended = ran(sys.executable, "-c", loaded, check=True)
    assert ended.stdout.strip() == "['mrwork', 'mrwork.cli', 'mrwork.cli.signals']"


LOST = """
import os, signal, sys, time, weakref
from mrwork.cli.signals import StopSignals

signals = StopSignals.of_this_process()
signals.interrupt()

class Thing:
    pass

def released(reference):
    os.kill(os.getpid(), signal.SIGTERM)
    for _ in range(1000):
        pass

thing = Thing()
reference = weakref.ref(thing, released)
try:
    del thing
    time.sleep(60)
except KeyboardInterrupt:
    print(signals.status)
"""


def assert_interrupted(program: str) -> None:
    """A program that sends SIGTERM to itself is interrupted, and prints the status of that alone."""
    ended = ran(sys.executable, "-c", program)
    assert (ended.stdout, ended.stderr) == (f"{128 + signal.SIGTERM}\n", "")


def test_an_interrupt_while_an_object_is_released_is_not_lost() -> None:
    assert_interrupted(LOST)


CLEARED = """
import os
import signal
import sys
import time
from importlib.machinery import ExtensionFileLoader

from mrwork.cli.signals import StopSignals

signals = StopSignals.of_this_process()
signals.interrupt()

class Loader(ExtensionFileLoader):
    def exec_module(self, module):
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.1)
        except KeyboardInterrupt:
            print("cleared")

try:
    Loader("compiled", "compiled.so").exec_module(None)
    time.sleep(60)
except KeyboardInterrupt:
    print(signals.status)
"""


def test_an_interrupt_while_a_compiled_module_is_loaded_comes_after_it() -> None:
    # Such a module may clear the exceptions of the Python code that it runs, and with them an interrupt.
    assert_interrupted(CLEARED)


def test_a_terminated_identification_keeps_what_it_has(tmp_path: Path) -> None:
    out = tmp_path / "run"
    # The optimiser of the last stage is loaded while the search runs.
    sizes = ("--every", "8", "--search", "genetic", "--population", "16", "--generations", "3", "--quiet")
    command = ("identify", "synthetic:spencer1997", "--model", "bouc_wen", *sizes, "--out", out)
    ended = signalled(signal.SIGTERM, 1, *command, module="scipy.optimize")
    assert ended.returncode == 128 + signal.SIGTERM, ended.stderr
    assert "with --resume to continue" in ended.stderr
    assert json.loads((out / "fit.json").read_text())["status"] == "interrupted"


SIZES = ("--model", "bingham", "--every", "20", "--population", "8", "--generations", "2")


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (signal.SIGINT, ("respond", "clairvoyant.toml")),
        (signal.SIGTERM, ("tune", "gradients.toml")),
        (signal.SIGTERM, ("identify", "synthetic:spencer1997", *SIZES)),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else value.name,
)
def test_an_interrupted_page_loses_no_result_and_is_drawn_by_resume(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.StopSignals, words: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in STUDIES.items():
        Path(f"{name}.toml").write_text(
            text.replace("[clairvoyant]\nrandom_starts = 0\n", "").replace("steps = 1", "steps = 0")
        )
    command = (*words, "--quiet", "--threads", "1", "--out", "run")
    # It is loaded when the first figure is written.
    ended = signalled(number, 1, *command, module="matplotlib.backends.backend_mixed")
    assert ended.returncode == 128 + number, ended.stderr
    (sentence,) = (line for line in ended.stderr.splitlines() if "mrwork: " in line)
    assert "interrupted while the page was drawn; the results are in run" in sentence
    assert "Report: " not in ended.stdout
    result = "fit.json" if words[0] == "identify" else "results.json"
    names = ("journal.jsonl", result)
    kept = [Path("run", name).read_bytes() for name in names]
    assert not Path("run.part").exists()
    printed(*command, "--resume")
    assert "<svg" in Path("run", "report.html").read_text()
    # Nothing was computed again: each step is recalled with the time that it took.
    assert Path("run", "journal.jsonl").read_bytes() == kept[0]
    if words[0] == "respond":
        assert Path("run", result).read_bytes() == kept[1]


# What is printed


def test_json_is_strict(capsys: pytest.CaptureFixture[str]) -> None:
    print_json({"a": float("inf"), "b": [float("nan"), np.float64("-inf"), 1.0], "c": "\x1b\udcff\u00b5"})
    text = capsys.readouterr().out
    assert json.loads(text) == {"a": None, "b": [None, None, 1.0], "c": "\x1b\udcff\u00b5"}
    assert "NaN" not in text
    assert "Infinity" not in text
    assert text[:-1].isprintable()


def test_one_home_prints() -> None:
    for file in (ROOT / "cli").glob("*.py"):
        text = file.read_text()
        assert "print(" not in text.replace("print_json(", ""), file
        assert "json.dumps" not in text or file.name == "output.py", file


def test_lists_of_keys_are_no_json() -> None:
    for option in ("--schema", "--laws"):
        ended = mrwork("respond", option, "--json")
        assert (ended.returncode, ended.stdout) == (2, "")


def test_control_characters_are_shown_as_escapes(capsys: pytest.CaptureFixture[str]) -> None:
    name = "a\x1b[31m\x07\x9b\u202eb\r"
    show(f"{name}\nnext")
    note(f"{name}\nnext")
    shown = capsys.readouterr()
    assert shown.out == r"a\x1b[31m\x07\x9b\u202eb\r" + "\nnext\n"
    assert shown.err == r"mrwork: a\x1b[31m\x07\x9b\u202eb\r\nnext" + "\n"


def test_a_name_with_control_characters_commands_no_terminal(tmp_path: Path) -> None:
    time = np.arange(0.0, 2.0, 0.01)
    rows = "\n".join(f"{t:.2f},{np.sin(t):.6f},{np.cos(t):.6f}" for t in 6.0 * time)
    record = tmp_path / "\x1b[31mred\n\u202etest.csv"
    record.write_text(f"t_s,displacement_mm,force_N\n{rows}\n")
    text = printed("check", record)
    assert r"\x1b[31mred\n\u202etest" in text.splitlines()[0]
    assert all(line.isprintable() for line in text.splitlines())
    (facts,) = json.loads(mrwork("check", record, "--json").stdout)["files"]
    assert facts["file"] == str(record)


def test_warnings_of_libraries_are_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with warnings_in_one_line():
        warnings.simplefilter("always")
        warnings.warn("overflow\nin \x1b exp", RuntimeWarning, stacklevel=1)
        logger = logging.getLogger("of_a_library")
        # The test runner listens at the root.
        logger.propagate = False
        logger.warning("no\n%s", "font")
    assert capsys.readouterr().err.splitlines() == [
        r"mrwork: warning: a library reports RuntimeWarning: overflow\nin \x1b exp",
        r"mrwork: warning: a library reports: no\nfont",
    ]


def test_a_runtime_warning_of_a_library_is_shown_to_those_who_ask_for_it_only(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for asked, shown in ((False, 0), (True, 1)):
        with warnings.catch_warnings():
            warnings.resetwarnings()
            if asked:
                warnings.simplefilter("always", RuntimeWarning)
            with warnings_in_one_line():
                warnings.warn("overflow", RuntimeWarning, stacklevel=1)
        assert len(capsys.readouterr().err.splitlines()) == shown


def test_streams_that_are_no_files_are_served() -> None:
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        show("a")
        note("b")
    assert (out.getvalue(), err.getvalue()) == ("a\n", "mrwork: b\n")
