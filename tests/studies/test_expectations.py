"""Figures of a study beside those that its file expects."""

from __future__ import annotations

from pathlib import Path

import pytest

from studies.common.expected import departures

EXPECTED = """
a.b = { value = 1.0, tolerance = 0.1 }
c = { most = 1.0 }
d = "diverged"
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "expected.toml"
    path.write_text(EXPECTED, encoding="utf-8")
    return path


def test_a_figure_outside_is_named(file: Path) -> None:
    wrong = departures({"a": {"b": 1.2}, "c": 2.0, "d": "finished"}, file)
    assert [sentence.partition(" is ")[0] for sentence in wrong] == ["a, b", "c", "d"]


def test_figures_within_their_limits_are_not(file: Path) -> None:
    assert departures({"a": {"b": 1.05}, "c": 1.0, "d": "diverged"}, file) == []


def test_what_was_not_measured_is_not_judged(file: Path) -> None:
    assert departures({}, file) == []
