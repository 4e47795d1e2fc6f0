"""Journals of unfinished runs, in a folder `RUN.part` beside the run folder until the run is written.

The journal of a result that is added to a run folder grows in that folder, as `NAME.part`. A journal outlives its run
where the run can be resumed: after an interrupt, and after a fault of the machine, such as a full disk or a lost
worker. After an error of the inputs, which would come again, it is removed.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from filecmp import cmp
from pathlib import Path
from types import TracebackType

from mrwork.base.numbers import counted
from mrwork.errors import JournalError, LibraryError, MrworkError, OutputError, WorkerError
from mrwork.store.input_file import bytes_of
from mrwork.store.journal import JOURNAL_FILE, Journal, n_steps
from mrwork.store.output_file import (
    Lock,
    check_own,
    check_own_folder,
    discard_folder,
    explain_failure,
    is_lock,
    new_file,
    refuse_special,
)
from mrwork.store.output_folder import Destination, adding, replacing_run
from mrwork.store.run_folder import (
    HISTORIES,
    JOURNAL,
    MANIFEST,
    MODELS,
    chunks_beside,
    is_part,
    name_unfinished,
    part_of,
    read_manifest_if_whole,
    real_place,
)

_STEP_SUFFIX = ".jsonl"
_COPYING = "copying"
_TO_RESUME = "run the same command with --resume to continue"
INTERRUPTED = "interrupted"
"""Status in the manifest of a run that was written before its end."""


def is_complete(path: str | Path) -> bool:
    """Whether the folder at `path` has a run that was not interrupted; one with a damaged manifest counts."""
    manifest = real_place(path) / MANIFEST
    return manifest.exists() and read_manifest_if_whole(manifest).get("status") != INTERRUPTED


def nothing_to_resume(path: Path) -> str:
    """What is said where --resume is given for what is complete; its result is shown, and its page drawn again."""
    return f"{path} is complete; nothing to resume"


@contextmanager
def run_journal(destination: Destination, *, resume: bool, note: Callable[[str], None]) -> Iterator[Journal]:
    """The journal of a run, begun or resumed; it and the run folder are locked until the end of the block."""
    path = destination.path
    with replacing_run(destination):
        if not (resume or destination.replace):
            _refuse_unfinished(path, [part_of(path) / JOURNAL])
        journal = resume_journal(path, note=note) if resume else begin_journal(path)
        with _outliving(journal, real_place(path) / JOURNAL, resume=resume):
            yield journal


@contextmanager
def addition_journal(
    kept: Path, *, resume: bool, replace: bool, note: Callable[[str], None]
) -> Iterator[Journal]:
    """The journal of an addition, begun or resumed, that the block moves to `kept`; both are locked until its end."""
    with adding(kept.parent, kept.name):
        if not (resume or replace):
            _refuse_unfinished(kept, [name_unfinished(kept)])
        journal = resume_addition(kept, note=note) if resume else begin_addition(kept)
        with _outliving(journal, kept, resume=resume):
            yield journal


def _refuse_unfinished(path: Path, journals: Iterable[Path]) -> None:
    """Refuse to begin where an unfinished run has steps, in `journals` or in the folder of an interrupted run."""
    place, steps = real_place(path), 0
    interrupted = (place / MANIFEST).exists() and not is_complete(place)
    for journal in (*journals, *([place / JOURNAL] if interrupted else [])):
        check_own(journal)
        steps += n_steps(journal)
    if steps:
        raise JournalError(
            f"{path} has an unfinished run of {counted(steps, 'step')}; run the same command with --resume to continue "
            "it, or with --replace to begin anew"
        )


@contextmanager
def _outliving(journal: Journal, kept: Path, *, resume: bool) -> Iterator[None]:
    """Close a journal at the end of the block, and remove it after an error if it is of no use."""
    try:
        yield
    except BaseException as error:
        if not journal.is_own or _comes_again(error, resume=resume) or is_copy(kept, journal):
            discard_journal(journal)
        elif isinstance(error, KeyboardInterrupt):
            error.add_note(_TO_RESUME)
        raise
    finally:
        journal.close()


def _comes_again(error: BaseException, *, resume: bool) -> bool:
    """Whether an error is of the inputs; in a run that is resumed they are those of before."""
    fault = isinstance(error, JournalError | LibraryError | OutputError | WorkerError)
    return isinstance(error, MrworkError) and not fault and not resume


def begin_journal(path: str | Path) -> Journal:
    """Begin a journal for the run folder at `path`, locked; an earlier run there does not change."""
    return Journal(_folder(path) / JOURNAL, replace=True).lock()


def resume_journal(path: str | Path, *, note: Callable[[str], None]) -> Journal:
    """Resume, locked, the journal of an unfinished run to `path`, or of the run there, which may be interrupted.

    `note`: called with a sentence if the end of the journal is damaged and ignored.
    """
    begun = part_of(path) / JOURNAL
    check_own_folder(begun.parent)
    missing = f"journal to resume, neither {begun.parent.name}/{JOURNAL} nor {JOURNAL} in {path}"
    return _resume(real_place(path) / JOURNAL, begun, lambda: _folder(path) / _COPYING, missing, note)


def discard_journal(journal: Journal) -> None:
    """Remove a journal that is no longer needed, the histories beside it, and its folder."""
    with suppress(OSError):
        if journal.is_own:
            journal.path.unlink()
        discard_folder(chunks_beside(journal.path))
        if is_part(journal.path.parent):
            discard_folder(journal.path.parent / HISTORIES)
        journal.close()
        # Fails, and keeps the folder, if it holds another journal.
        journal.path.parent.rmdir()


def is_copy(kept: Path, journal: Journal) -> bool:
    """Whether a journal equals the complete one at `kept`."""
    with suppress(OSError):
        return cmp(journal.path, kept, shallow=False)
    return False


def begin_addition(kept: Path) -> Journal:
    """Begin a journal that `keep_addition` moves to `kept`; an earlier one there does not change before."""
    return Journal(name_unfinished(kept), replace=True).lock()


def resume_addition(kept: Path, *, note: Callable[[str], None]) -> Journal:
    """Resume a journal as `begin_addition` begins it, or the complete one at `kept`; raises as `resume_journal`."""
    copying = kept.with_name(f".{kept.name}.{_COPYING}")
    return _resume(kept, name_unfinished(kept), lambda: copying, f"{kept} to resume", note)


def _resume(
    kept: Path, begun: Path, copying: Callable[[], Path], missing: str, note: Callable[[str], None]
) -> Journal:
    """Resume the journal at `begun`, or a copy of the complete one at `kept`; what is `missing` where none is."""
    for path in (kept, begun):
        check_own(path)
    if not begun.is_file():
        if not kept.is_file():
            raise JournalError(f"there is no {missing}; run without --resume")
        _copy(kept, begun, copying())
    return Journal(begun, resume=True, note=note).lock()


def keep_addition(journal: Journal, kept: Path) -> None:
    """Move a complete journal to its place."""
    journal.finish()
    refuse_special(kept)
    with explain_failure(f"move {journal.path} to {kept.name}", "if the run was replaced, run again"):
        journal.path.replace(kept)


def _copy(kept: Path, begun: Path, copying: Path) -> None:
    """Copy a complete journal to where it grows, unless another process does so."""
    with explain_failure(f"write {begun}", "make room, or choose another folder"), Lock(begun):
        if not begun.is_file():
            content = bytes_of(kept, JOURNAL_FILE)
            try:
                # Under another name first, so that an incomplete copy is not taken for a journal.
                with new_file(copying) as target:
                    target.write(content)
                copying.rename(begun)
            finally:
                copying.unlink(missing_ok=True)


class StepJournals:
    """Journals of the steps of a comparison of models, such as `dahl/fit`; locked together until `close`.

    Leaving a `with` block closes them, and removes them after an error of the inputs. Existing ones are continued with
    `resume`, else removed; those that have recorded steps only where the destination may be replaced.
    """

    def __init__(
        self, destination: Destination, *, resume: bool, note: Callable[[str], None] | None = None
    ) -> None:
        self._folder = part_of(destination.path) / MODELS
        self._resume = resume
        self._note = note
        for each in (self._folder.parent, self._folder):
            check_own_folder(each)
        if resume and not self._folder.is_dir():
            raise JournalError(
                f"there is no comparison to resume in {self._folder.parent.name}/{MODELS}; run without --resume"
            )
        with explain_failure(f"make {self._folder}", "choose another folder"), ExitStack() as locked:
            locked.enter_context(replacing_run(destination))
            if not (resume or destination.replace):
                _refuse_unfinished(destination.path, self._folder.rglob(f"*{_STEP_SUFFIX}"))
            if not resume:
                if self._folder.exists():
                    shutil.rmtree(self._folder)
                self._folder.mkdir(parents=True)
            self._locked = locked.pop_all()

    def __call__(self, step: str) -> Journal:
        """Journal of a step: resumed if there is one, else begun."""
        path = self.path(step)
        check_own_folder(path.parent)
        path.parent.mkdir(exist_ok=True)
        return Journal(path, resume=self._resume and path.is_file(), note=self._note)

    def path(self, step: str) -> Path:
        """Path of the journal of a step."""
        return self._folder / f"{step}{_STEP_SUFFIX}"

    def close(self) -> None:
        """Let another process have the journals."""
        self._locked.close()

    def __enter__(self) -> StepJournals:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None and _comes_again(error, resume=self._resume):
            self.discard()
        elif isinstance(error, KeyboardInterrupt):
            error.add_note(_TO_RESUME)
        self.close()

    def discard(self) -> None:
        """Remove the journals, which are no longer needed."""
        with suppress(OSError):
            shutil.rmtree(self._folder)
            self.close()
            # Fails, and keeps the folder, if it holds another journal.
            self._folder.parent.rmdir()


def _folder(path: str | Path) -> Path:
    folder = part_of(path)
    check_own_folder(folder)
    with explain_failure(f"make {folder}", "choose another folder"):
        folder.mkdir(parents=True, exist_ok=True)
        names = {entry.name for entry in folder.iterdir() if not is_lock(entry.name)}
    foreign = sorted(names - {JOURNAL, _COPYING, MODELS, HISTORIES, chunks_beside(folder / JOURNAL).name})
    if foreign:
        raise OutputError(
            f"{folder} is where the journal of the run belongs, but it holds {foreign[0]}; choose another folder"
        )
    return folder
