"""A plugin of pytest (Python 3.12 or later): which tests execute each line of the package.

    LINES_OUT=FOLDER python -m pytest -p tools.faults.lines -W ignore::pytest.PytestAssertRewriteWarning

Each process writes FOLDER/PID.json: tests by file and line. `tools.faults.strength` reads them.
"""

from __future__ import annotations

import atexit
import json
import os
import sys
from pathlib import Path
from types import CodeType

import mrwork

ROOT = f"{Path(mrwork.__file__).parent}{os.sep}"
OUT = Path(os.environ["LINES_OUT"])
_TOOL = 4
_tests: dict[str, dict[int, set[str]]] = {}
_current = ["import"]


def _line(code: CodeType, number: int) -> object:
    if code.co_filename.startswith(ROOT):
        lines = _tests.setdefault(code.co_filename.removeprefix(ROOT), {})
        lines.setdefault(number, set()).add(_current[0])
    return sys.monitoring.DISABLE


def pytest_runtest_logstart(nodeid: str) -> None:
    """From here on lines are executed by this test."""
    _current[0] = nodeid
    sys.monitoring.restart_events()


def _write() -> None:
    OUT.mkdir(parents=True, exist_ok=True)
    found = {file: {n: sorted(each) for n, each in lines.items()} for file, lines in _tests.items()}
    (OUT / f"{os.getpid()}.json").write_text(json.dumps(found))


sys.monitoring.use_tool_id(_TOOL, "lines")
sys.monitoring.register_callback(_TOOL, sys.monitoring.events.LINE, _line)
sys.monitoring.set_events(_TOOL, sys.monitoring.events.LINE)
atexit.register(_write)
