"""The page of any run folder, drawn again from what the folder holds."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from mrwork.base.arguments import checked
from mrwork.base.progress import OnProgress
from mrwork.report.fit.page import fit_page, open_run
from mrwork.report.html import Page
from mrwork.report.page_options import EveryTest, Summary
from mrwork.report.study.page import study_page
from mrwork.runs.load import read_run
from mrwork.store.run_folder import FIT_RUN, RunFolder
from mrwork.study.histories import read_history
from mrwork.study.results import StudyResults
from mrwork.uncertainty.bands.prediction import Prediction


@checked
def write_page(
    run: str | Path,
    *,
    summary: Summary = False,
    every_test: EveryTest = False,
    on_progress: OnProgress | None = None,
) -> Path:
    """Draw the page of a run folder of any verb, and write it into the folder.

    Parameters
    ----------
    run
        The folder, as of `load`.
    on_progress
        Called with the progress.

    Raises
    ------
    RecordError
        Where it is no run folder, or one of its files is damaged.

    Examples
    --------
    >>> import mrwork as mr
    >>> mr.report.write_page("out/demo", summary=True)  # doctest: +SKIP
    PosixPath('out/demo/summary.html')
    """
    path = Path(run)
    page, _ = page_of(path, summary=summary, every_test=every_test, on_progress=on_progress)
    return page.write(path, summary=summary)


def page_of(
    path: Path, *, summary: bool, every_test: bool, on_progress: OnProgress | None
) -> tuple[Page, tuple[Prediction, ...]]:
    """The page of the run folder at `place`, and the tests of a fit with the forces of its model."""
    opened = RunFolder.open(path)
    if opened.kind is FIT_RUN:
        run, predictions = open_run(path)
        drawn = fit_page(run, predictions, every_test=every_test, summary=summary, on_progress=on_progress)
        return drawn, predictions
    stated, results = opened.manifest, read_run(path)
    made = {"command": stated.get("command", ""), "seconds": stated.get("seconds")}
    assert isinstance(results, StudyResults)
    return study_page(results, partial(read_history, path), **made, summary=summary), ()
