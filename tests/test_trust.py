"""What SECURITY.md says about code of others and about connections."""

import ast
import io
import os
import re
from pathlib import Path

import numpy as np
from refusals import refusal
from report_samples import fit as sample_fit
from report_samples import prediction
from run_folders import write_fit

import mrwork
from mrwork.store.run_folder import PREDICTIONS, RunFolder
from mrwork.store.run_writer import add_to_run
from mrwork.uncertainty.bands.calibration_files import read_predictions
from test_imports import imports_of, in_fresh_process

PACKAGE = Path(mrwork.__file__).parent
# Packages that run what a file says, or that reach other machines and processes, and the modules that may import them.
LINK = "closed_loop/controller_link.py"  # a controller of the user: a program, or a UDP port
HOMES = {
    "socket": ("store/output_file.py", LINK),  # of the former the name of the machine
    "subprocess": (LINK, "embedded/fmu.py"),  # and the compiler of an FMU
    "pickle": (
        "workers/engine.py",
    ),  # what an executor would pickle itself, once for all chunks; never files
    "multiprocessing": ("workers/local.py",),  # workers of this machine
}
HOMELESS = {
    *("cloudpickle", "marshal", "shelve", "joblib", "yaml", "ctypes", "code"),
    *("urllib", "http", "ftplib", "ssl", "asyncio", "requests"),
}
RUN_CODE = {"exec", "eval", "__import__"}
NO_CONNECTION = """
import sys
REFUSED = "socket.connect", "socket.bind", "socket.getaddrinfo", "urllib.Request", "subprocess.Popen", "os.system"
seen = []
sys.addaudithook(lambda event, _: seen.append(event) if event in REFUSED else None)
from mrwork.cli import main
try: main(sys.argv[1:])
except SystemExit as ended: assert not ended.code
assert not seen, seen
"""


def test_packages_that_run_files_or_reach_out_have_their_homes() -> None:
    for file in PACKAGE.rglob("*.py"):
        name = file.relative_to(PACKAGE).as_posix()
        imported = imports_of(file)
        assert not imported & HOMELESS, name
        assert all(name in homes for package, homes in HOMES.items() if package in imported), name


def test_code_of_others_is_run_in_one_place() -> None:
    callers = set()
    for file in PACKAGE.rglob("*.py"):
        text = file.read_text()
        if not any(f"{name}(" in text for name in RUN_CODE):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in RUN_CODE:
                callers.add(file.relative_to(PACKAGE).as_posix())
    assert callers == {"store/user_python.py"}


class Hostile:
    """What creates a folder when its pickle is read."""

    def __init__(self, place: Path) -> None:
        self.place = place

    def __reduce__(self) -> object:
        return os.mkdir, (str(self.place),)


def test_arrays_of_objects_are_refused_and_not_unpickled(tmp_path: Path) -> None:
    harm = tmp_path / "harm"
    forged = io.BytesIO()
    np.savez(forged, force=np.array([Hostile(harm)], dtype=object))
    run = write_fit(tmp_path / "run", sample_fit(prediction()))
    add_to_run(run, {PREDICTIONS: forged.getvalue()})
    refusal(read_predictions, RunFolder.open(run), match="cannot be read .*allow_pickle")
    assert not harm.exists()


def test_identification_and_its_page_open_no_connection(tmp_path: Path) -> None:
    run = tmp_path / "run"
    # The first one to draw on a machine has Matplotlib list its fonts, by a program of the system.
    in_fresh_process("import matplotlib.font_manager")
    in_fresh_process(
        NO_CONNECTION, "identify", "synthetic:spencer1997", "--model=bingham", "--every=8", f"--out={run}"
    )
    page = (run / "report.html").read_text(encoding="utf-8")
    assert "<script" not in page
    # Addresses are names of XML dialects only.
    assert {re.sub(r"[^/]*$", "", found) for found in re.findall(r"https?://[^\"'\s<)]+", page)} <= {
        "http://www.w3.org/2000/",
        "http://www.w3.org/1999/",
        "http://www.w3.org/1998/Math/",
    }


def test_security_names_tests_that_exist() -> None:
    root = Path(__file__).parents[1]
    named = re.findall(r"`(tests/[\w/]+\.py)`", (root / "SECURITY.md").read_text(encoding="utf-8"))
    assert named
    assert [name for name in named if not (root / name).is_file()] == []
