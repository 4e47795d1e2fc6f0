"""A few of the odd command lines of `invocations.py`, and that it notices what is wrong."""

from __future__ import annotations

import pytest
from command_line import Ended

from tools.faults.invocations import all_tried, misprinted, table


def test_odd_command_lines_end_in_a_result_or_a_sentence(capfd: pytest.CaptureFixture[str]) -> None:
    counts = all_tried(["models", "check", "predict", "convert"], 15, 1, full=False)
    assert all(count.cases.total() == 15 for count in counts.values())
    assert not any(count.wrong for count in counts.values()), table(counts)
    assert all(count.statuses[2] for count in counts.values())


@pytest.mark.parametrize(
    ("ended", "wrong"),
    [
        (Ended(returncode=2, stdout="", stderr="mrwork: no\n"), ""),
        (Ended(returncode=0, stdout="{}\n", stderr="mrwork: warning: x\n"), ""),
        (Ended(returncode=1, stdout="", stderr="mrwork: no\n"), "exit status 1"),
        (Ended(returncode=2, stdout="", stderr=""), "0 sentences"),
        (Ended(returncode=2, stdout="", stderr="mrwork: one\nmrwork: two\n"), "2 sentences"),
        (Ended(returncode=2, stdout="", stderr="mrwork: \x1b[31m\n"), "stderr is"),
        (Ended(returncode=0, stdout="{}\n", stderr="RuntimeWarning: x\n"), "stderr is"),
        (Ended(returncode=0, stdout='{"a": NaN}\n', stderr=""), "no strict JSON"),
        (Ended(returncode=0, stdout="\x1b[31m\n", stderr=""), "not printable"),
    ],
)
def test_what_is_wrong_is_noticed(ended: Ended, wrong: str) -> None:
    found = misprinted(ended, as_json=ended.stdout.startswith("{"))
    assert (wrong in found[0]) if wrong else not found
