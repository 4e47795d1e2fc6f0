"""Output that verbs share: progress on stderr, JSON, tables, and the page of a run, which is written again."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from mrwork.base.progress import OnProgress, Progress, ProgressLine, display_here
from mrwork.base.summary import Summarised, Summary
from mrwork.cli.terminal import note, show, write_stderr
from mrwork.errors import MrworkError, OutputError, SettingError, reason_of
from mrwork.store.codec import plain
from mrwork.store.output_file import write_file
from mrwork.store.run_folder import check_output

if TYPE_CHECKING:
    from mrwork.base.remark import Verb
    from mrwork.identification.fit import Fit
    from mrwork.records import DamperTest
    from mrwork.records.reading import OnRead

PATIENCE = 2.0
"""Seconds until the progress line appears, for computations that are often shorter."""


def is_quiet(options: argparse.Namespace) -> bool:
    """Whether --quiet or --json leaves out the progress line."""
    return bool(options.json or getattr(options, "quiet", False))


def progress_line(options: argparse.Namespace, *, patience: float = PATIENCE) -> ProgressLine:
    """A line of progress, which is cleared at the end; with --quiet or --json nothing."""
    display = None if is_quiet(options) else display_here(write=write_stderr, note=note)
    return ProgressLine(display, patience=patience)


@contextmanager
def reading_line(options: argparse.Namespace) -> Iterator[OnRead]:
    """Progress line with the number of tests that have been read."""
    with progress_line(options, patience=0.0) as line:

        def report(done: int, total: int) -> None:
            said = "reading the test" if total == 1 else f"reading {done + 1} of {total} tests"
            line(Progress(stage="reading", said=(said,)))

        yield report


def print_json(document: object) -> None:
    """Print an object in one line of strict JSON; numbers that are not finite become null, as in the files."""
    show(json.dumps(plain(document, packs=False, lacking=lambda _: None), allow_nan=False))


def print_result(options: argparse.Namespace, document: object, text: str) -> None:
    """Print what a verb found: the `document` with --json, else the `text`."""
    if options.json:
        print_json(document)
    else:
        show(text)


def show_results(
    options: argparse.Namespace,
    *results: Summarised | Summary,
    document: Mapping[str, object],
    below: Sequence[str] = (),
) -> None:
    """Print results: the `document` with --json, else their summaries and the lines `below`."""
    summaries = [result if isinstance(result, Summary) else result._summary() for result in results]
    texts = [summary.text(whole=True) for summary in summaries]
    print_result(options, document, "\n".join(["\n\n".join(texts), *below]))


def check_figure(path: Path) -> None:
    """Refuse a file of --figure that cannot be written, or of another format."""
    suffix = path.suffix.lower()
    if suffix not in (".svg", ".png"):
        raise SettingError(f"--figure {path} ends with {suffix or 'nothing'}; give .svg or .png")
    check_output(path, replace=True, otherwise="")


def write_figure(path: Path, figure: Any) -> None:
    """Write a figure of Matplotlib into a file that `check_figure` has seen."""
    from mrwork.plots.canvas import png_bytes, svg_bytes

    write_file(path, svg_bytes(figure) if path.suffix.lower() == ".svg" else png_bytes(figure))


def end_addition(
    options: argparse.Namespace, result: Summarised, more: Mapping[str, object], below: Sequence[str] = ()
) -> int:
    """Show what was added to a run, and draw the page of the run; return the exit status.

    With --json it is the document of the result, and what is `more` in it.
    """
    show_results(options, result, document={**result.document(), **more}, below=below)
    return renew_page(options, options.run_folder)


def told_remarks(
    verb: Verb, tests: Sequence[DamperTest], options: argparse.Namespace
) -> list[dict[str, Any]]:
    """Say what the checks found that matters to a verb, on stderr; with --json return it only, for the object."""
    from mrwork.records.remarks import remarks_for

    remarks = remarks_for(verb, tests)
    for remark in () if options.json else remarks:
        note(remark.in_words)
    return [asdict(remark) for remark in remarks]


def notes_on_verdicts(fit: Fit, kind: Literal["profile", "posterior"]) -> list[str]:
    """Lines on what verdicts mean, and where those of the fit come from if not from the intervals that are shown."""
    notes = [f"  {remark.in_words}" for remark in fit.remarks if remark.code == "residual_is_structure"]
    if (interval := fit.an_interval) is None or interval.kind != kind:
        source = "standard errors" if interval is None else f"{interval.heading}s"
        notes.append(f"  the verdicts of the fit, and of its page, stay those by its {source}")
    return notes


def renew_page(options: argparse.Namespace, folder: Path, *, summary: bool = False) -> int:
    """Draw the page of a run, or its front alone, from what its folder holds; return the exit status of `draw_last`."""

    def draw(on_progress: OnProgress) -> None:
        from mrwork.report.pages import write_page

        write_page(folder, summary=summary, on_progress=on_progress)

    return draw_last(options, folder, draw)


def draw_last(options: argparse.Namespace, folder: Path, draw: Callable[[OnProgress], None]) -> int:
    """Draw the page of a run, whose other files are written already: whatever fails is a warning.

    Return the exit status, see `drawing`; it is 2 where the page cannot be written.
    """
    with undrawn_warned(
        f"the page of {folder}", f"the results are written; mrwork report {folder} draws it"
    ) as failed:
        return drawing(options, folder, draw)
    return 2 if isinstance(failed[0], OutputError) else 0


@contextmanager
def undrawn_warned(what: str, remedy: str) -> Iterator[list[Exception]]:
    """Whatever fails in the block, which draws, is a warning, or an error of the page's own file, and in the list."""
    failed: list[Exception] = []
    try:
        yield failed
    except Exception as error:  # of whatever kind, it costs no results
        failed.append(error)
        reason = reason_of(error) if isinstance(error, MrworkError) else f"{type(error).__name__}: {error}"
        kind = "" if isinstance(error, OutputError) else "warning: "
        note(f"{kind}{what} was not drawn ({reason}); {remedy}")


def drawing(options: argparse.Namespace, folder: Path, draw: Callable[[OnProgress], None]) -> int:
    """Draw the page of a run, whose other files are written already, and show the progress.

    Return the exit status: 130 after Ctrl-C, when a message says how to draw the page later, otherwise 0.
    """
    try:
        with progress_line(options) as line:
            draw(line)
    except KeyboardInterrupt:
        note(
            f"interrupted while the page was drawn; the results are in {folder}; mrwork report {folder} draws it"
        )
        return 130
    return 0
