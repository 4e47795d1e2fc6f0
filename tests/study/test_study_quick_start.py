"""The study that the guide to studies begins with."""

from __future__ import annotations

from pathlib import Path

import measured_data
import pytest

from mrwork import Journal
from mrwork.study import read_study, run_study

ROOT = measured_data.ROOT
STUDY = ROOT / "studies" / "respond" / "quick_start.toml"


def test_the_guide_shows_the_study_as_it_is() -> None:
    assert (
        f'text = """\n{STUDY.read_text()}"""\n' in (ROOT / "docs" / "guides" / "write_a_study.md").read_text()
    )


def test_the_first_study_runs_without_a_warning_and_its_law_is_worth_it(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal")
    results = run_study(
        read_study(STUDY, lambda run: pytest.fail(f"{run} is not asked for")), journal=journal
    )
    journal.close()
    assert results.complete
    assert results.warnings() == []
    # The law, the best constant command, i = 0, no dampers.
    law, constant, off, none = (results.score(row) for row in (3, 4, 1, 0))
    assert law < constant < off < none
