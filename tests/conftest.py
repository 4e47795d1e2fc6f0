"""What all tests share.

JAX compiles quickly, a module's compiled functions are released when it ends, and Ctrl-C reaches what a test starts.
"""

import gc
import os
import signal
from collections.abc import Callable, Generator, Iterator
from typing import Any

import hypothesis
import pytest
from blank_pictures import all_pages, blank, drawn, no_pages
from compiled import release_compiled
from sentences import MEANT, TESTS, WRITES, Refused, golden, write

# A test compiles a function to run it a few times: without optimisation that takes a third of the time.
# A flag that is set already comes last, so it decides.
_QUICK_COMPILATION = "--xla_backend_optimization_level=0 --xla_cpu_parallel_codegen_split_count=1"
os.environ["XLA_FLAGS"] = f"{_QUICK_COMPILATION} {os.environ.get('XLA_FLAGS', '')}".strip()

# The matrices are small: a second thread of the linear algebra would wait for the first one, and count as work.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# No test asserts a wall time: an example that takes long on a loaded machine is not a wrong one.
hypothesis.settings.register_profile("mrwork", deadline=None)
hypothesis.settings.load_profile("mrwork")

# A background job of a shell ignores Ctrl-C, and so would every process that it starts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_finish() -> None:
    """Tests live as long as the process: nobody looks through them for garbage."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="module", autouse=True)
def _memory_is_given_back() -> Iterator[None]:
    yield
    release_compiled()


# Rooms in which verbs write pages that are not looked at; `tests/report` and `tests/studies` draw.
_BLANK = ("cli", "faults", "identification", "records", "store", "study", "tuning", "uncertainty", "workers")


@pytest.fixture(scope="module", autouse=True)
def _pictures(request: pytest.FixtureRequest) -> Iterator[None]:
    if request.path.parent.name in _BLANK:
        with blank(), no_pages():
            yield
    else:
        yield


@pytest.fixture(scope="module")
def pages() -> Iterator[None]:
    """Of a module in these rooms that reads pages, from the test on that asks for it; their pictures are blank."""
    with all_pages():
        yield


@pytest.fixture
def drawn_pictures() -> Iterator[None]:
    """Of a test in these rooms that looks at a picture."""
    with drawn(), all_pages():
        yield


INSTRUCTION_SETS = ("avx512", "avx2", "plain")


@pytest.fixture(params=INSTRUCTION_SETS)
def instruction_set(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Every instruction set that build and machine have, in force for the test."""
    if not _is_usable(request.param, monkeypatch):
        pytest.skip(f"this build or this machine has no {request.param}")
    return request.param


@pytest.fixture
def of_instruction_sets(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[], Any]], list[Any]]:
    """What a function returns with every instruction set that build and machine have."""

    def results(function: Callable[[], Any]) -> list[Any]:
        made = [function() for name in INSTRUCTION_SETS if _is_usable(name, monkeypatch)]
        if len(made) < 2:
            pytest.skip("build and machine have one instruction set in common, there is nothing to compare")
        return made

    return results


def _is_usable(name: str, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Whether build and machine have an instruction set, which is then in force."""
    from mrwork import _rust

    monkeypatch.setenv("MRWORK_INSTRUCTION_SET", name)
    try:
        _rust.instruction_set()
    except ValueError:
        return False
    return True


_came: dict[str, dict[str, list[str]]] = {}


@pytest.fixture
def refused(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Refused]:
    """What compares a refusal with its whole sentence; see `sentences.py`."""
    module, name = request.path.relative_to(TESTS).as_posix(), request.node.name
    refused = Refused(golden().get(module, {}).get(name, []), tmp_path_factory.getbasetemp())
    yield refused
    _came.setdefault(module, {})[name] = refused.came
    assert WRITES or refused.failed or len(refused.came) == len(refused.expected), MEANT


# What is wrong when a test fails, by folder; a file or a test of another kind is marked with it.
KINDS = {
    "physics": "equations, conservation, references outside, statistics, search",
    "contract": "registries, bits, the public face, formats to their numbers, resumed to the same result",
    "words": "sentences, pages, colours, prose",
    "machine": "kills, full disks, hostile files",
}
LONG = "long: seconds each; not of `make test`, where shorter tests reach the same code"
_OF_FOLDER = {
    "physics": (
        *("buildings", "closed_loop", "control", "dampers", "identification", "motions", "search", "studies"),
        *("tuning", "twins", "uncertainty"),
    ),
    "words": ("docs", "report"),
    "machine": ("faults", "store"),
}


def pytest_configure(config: pytest.Config) -> None:
    """`make test` runs what must be right in every change; `MRWORK_TESTS=all`, and who names files, all kinds."""
    for kind, meaning in KINDS.items():
        config.addinivalue_line("markers", f"{kind}: {meaning}")
    config.addinivalue_line("markers", LONG)
    whole = config.args_source is pytest.Config.ArgsSource.TESTPATHS
    if whole and not config.option.markexpr and os.environ.get("MRWORK_TESTS") != "all":
        config.option.markexpr = "(physics or contract) and not long"


def _kind(item: pytest.Item) -> str:
    marked = [mark.name for mark in item.iter_markers() if mark.name in KINDS]
    if len(marked) > 1:
        raise pytest.UsageError(f"{item.nodeid} is marked {marked[0]} and {marked[1]}; a test has one kind")
    if marked:
        return marked[0]
    if "refused" in getattr(item, "fixturenames", ()):
        return "words"
    folder = item.path.parent.name
    return next((kind for kind, folders in _OF_FOLDER.items() if folder in folders), "contract")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give each test its kind; run no others where the sentences are written."""
    for item in items:
        item.add_marker(_kind(item))
    if WRITES:
        items[:] = [item for item in items if "refused" in getattr(item, "fixturenames", ())]


@pytest.hookimpl(wrapper=True)
def pytest_report_teststatus(report: pytest.TestReport | pytest.CollectReport) -> Generator[None, Any, Any]:
    """A failure is listed with its kind."""
    category, letter, word = yield
    kinds = [kind for kind in KINDS if kind in getattr(report, "keywords", ())]
    return category, letter, f"{word} {kinds[0]}" if report.failed and kinds else word


def pytest_sessionfinish() -> None:
    if WRITES:
        write(_came)
