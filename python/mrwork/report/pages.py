"""The page of any run folder, drawn again from what the folder holds."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from mrwork.base.arguments import checked
from mrwork.report.fit.page import fit_page, open_run
from mrwork.report.section import OnDrawn, ignore_progress
from mrwork.report.study.page import study_page
from mrwork.store.run_folder import FIT_RUN, REPORT, STUDY_RUN, SUMMARY, RunFolder
from mrwork.store.run_writer import add_to_run
from mrwork.study.folder import read_results
from mrwork.study.histories import read_history
from mrwork.tuning.folder import read_tuning


@checked
def write_page(
    run: str | Path,
    *,
    summary: bool = False,
    every_test: bool = False,
    on_progress: OnDrawn = ignore_progress,
) -> Path:
    """Draw the page of a run folder of any verb, and write it into the folder.

    Parameters
    ----------
    run
        The folder, as of `load`.
    summary
        Write the front of the page alone, as ``summary.html``, beside ``report.html``.
    every_test
        Draw every test of a fit in full, and not the best, the median and the worst of many.
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
    place = Path(run)
    opened = RunFolder.open(place)
    stated = opened.manifest
    command = stated.get("command", "")
    if opened.kind is FIT_RUN:
        page = fit_page(*open_run(place), every_test=every_test, summary=summary, on_progress=on_progress)
    else:
        results = read_results(place) if opened.kind is STUDY_RUN else read_tuning(place)
        histories, seconds = partial(read_history, place), stated.get("seconds")
        page = study_page(results, histories, command=command, seconds=seconds, summary=summary)
    name = SUMMARY if summary else REPORT
    add_to_run(place, page.contents(name))
    return place / name
