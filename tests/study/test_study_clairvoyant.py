"""The non-causal optimum is a row of a study, ranked apart; its searches are in the journal."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from refusals import refusal

from mrwork import Journal
from mrwork.errors import Interrupted
from mrwork.study import StudyResults, compared, read_study, run_study
from mrwork.study.course import StudyProgress
from mrwork.study.folder import study_document

STUDY = """
[building]
published = "uts"

[[damper]]
storey = 1
preset = "kwok2006"
lag = 190
differential = true

[[controller]]
law = "clipped_optimal"
settings = { drifts = 1, control_weight = 1e-13 }

[[motion]]
synthetic = "kanai_tajimi"
duration = 1
pga = "0.1 g"

[report]
histories = "none"
"""
ASKED = STUDY + '[clairvoyant]\ninterval = "20 ms"\nexplore = 1\nfinish = 1\n'


def ran(folder: Path, *, resume: bool = False, stop: str = "nowhere") -> StudyResults:
    """Run the study; Ctrl-C comes when a label contains `stop`."""
    path = folder / "study.toml"
    path.write_text(ASKED)

    def on_progress(progress: StudyProgress) -> None:
        if stop in progress.label:
            raise KeyboardInterrupt

    with_journal = Journal(
        folder / f"journal {stop}" if not resume else folder / "journal random", resume=resume
    )
    try:
        return run_study(read_study(path), journal=with_journal, on_progress=on_progress)
    finally:
        with_journal.close()


def test_the_row_is_ranked_apart_and_resumes_to_the_bit(tmp_path: Path) -> None:
    whole = ran(tmp_path)
    last = len(whole.rows) - 1
    assert (whole.rows[last].label, whole.complete) == ("Clairvoyant", True)
    assert [rank.name for rank, rows in compared(whole).ranks if last in rows] == ["clairvoyant"]
    # The commands of the law are a start, as means over the intervals.
    found = whole.clairvoyants[0]
    assert "Clipped-optimal" in [start.name for start in found.starts]
    assert whole.score(last) == pytest.approx(found.score, rel=1e-12)
    document = study_document(whole)
    assert document["clairvoyant"][0]["score"] == found.score
    assert "not certified" in document["clairvoyant"][0]["statement"]
    with pytest.raises(Interrupted) as stopped:
        ran(tmp_path, stop="random")
    assert (last, 0) not in stopped.value.result.runs
    lines = (tmp_path / "journal random").read_text().count("\n")
    resumed = ran(tmp_path, resume=True)
    np.testing.assert_array_equal(resumed.clairvoyants[0].commands.command, found.commands.command)
    # The searches that were done are not done again.
    assert (tmp_path / "journal random").read_text().count("\n") == lines + 2


@pytest.mark.parametrize(
    ("before", "after", "word"),
    [
        ('"20 ms"', '"20.5 ms"', "interval.*multiple"),
        ("[clairvoyant]", "[hardware]\ncommand_rate = 5\n[clairvoyant]", "command_rate; leave one out"),
    ],
)
def test_an_optimum_that_cannot_be_searched_for_is_refused(
    before: str, after: str, word: str, tmp_path: Path
) -> None:
    path = tmp_path / "study.toml"
    path.write_text(ASKED.replace(before, after))
    refusal(read_study, path, match=word)
