"""Runs made in their folder, and files added to one: what would be lost is asked first, the manifest is the commit.

A run grows in its folder from the start, under the names of its files; beside a manifest as NAME.new. Its journal is
made first, empty, and removed last: wherever its writer is killed, the folder is known for that of a run. A verb
replaces without asking only a run of its own, unchanged since and with nothing added by later verbs.

`RUN/.lock` is held while a run is made, and while files are added; who adds one file for hours holds the lock of its
name. What replaces a run excludes all else, what adds to it excludes the same addition.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, suppress
from functools import partial
from itertools import chain
from pathlib import Path, PurePath
from types import MappingProxyType
from typing import Final

from mrwork.base.numbers import counted
from mrwork.base.summary import list_names
from mrwork.errors import JournalError, OutputError
from mrwork.store.input_file import exists
from mrwork.store.journal import Journal, is_journal, journal_in_run, n_steps
from mrwork.store.output_file import Lock, explain_failure, open_to_write
from mrwork.store.run_folder import (
    ADDITIONS,
    CHAIN,
    FILES,
    FORMAT,
    HISTORIES,
    INTERRUPTED,
    JOURNAL,
    JOURNALS,
    MANIFEST,
    MODELS,
    NEW,
    OWN,
    OWN_NAMES,
    REDRAWN,
    RunFolder,
    RunKind,
    chunks_beside,
    commit,
    digest_at,
    file_digest,
    is_added,
    make_folders,
    manifest_document,
    real_path,
    refuse_path_in_run,
)

_TO_RESUME: Final = "run the same command with --resume to continue"


def nothing_to_resume(path: Path) -> str:
    """What is said where --resume is given for what is complete; its result is shown, and its page drawn again."""
    return f"{path} is complete; nothing to resume"


def is_complete(path: str | Path) -> bool:
    """Whether the folder at `path` has a run that was not interrupted."""
    run = RunFolder.at(real_path(path))
    return run is not None and run.is_complete


def _files_in(folder: Path, owned: Callable[[str], bool]) -> list[str]:
    """Paths of the files in a folder, and below it, whose first name is an `owned` one; links are not followed."""
    entries = [entry for entry in folder.iterdir() if owned(entry.name)]
    below = chain.from_iterable(entry.rglob("*") for entry in entries if not entry.is_symlink())
    paths = {path for path in chain(entries, below) if path.is_symlink() or not path.is_dir()}
    return sorted(path.relative_to(folder).as_posix() for path in paths)


def _entries_of(names: Iterable[str]) -> list[str]:
    """Files, and folders in the place of the files in them."""
    return list(dict.fromkeys(first + slash for first, slash, _ in (name.partition("/") for name in names)))


def _differs(run: RunFolder, name: str) -> bool:
    """Whether a file of the verb is not as it has written it."""
    path = run.real_path / name
    if name.partition("/")[0] in REDRAWN or is_added(name) or not exists(path):
        return False
    return path.is_symlink() or not path.is_file() or digest_at(name, path) != run.files[name]


class RunAtWork:
    """A run that a verb makes in its folder, which is locked in the block, until `commit` or its end.

    `path`: as the user names it, perhaps a link. `replace`: whether a run of another verb, later additions and changed
    files may be lost. `resume`: whether the run there is continued. `note` is called with a sentence where the end of a
    journal is damaged and ignored.
    """

    def __init__(
        self,
        path: Path,
        kind: RunKind,
        *,
        replace: bool = False,
        resume: bool = False,
        note: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.path, self.kind, self.replace, self.resume, self._note = path, kind, replace, resume, note
        self.folder = real_path(path)
        """The folder, without links."""
        self._journals: list[Journal] = []
        self._locked = ExitStack()
        self._earlier: RunFolder | None = None
        self._listed: Mapping[str, str] = {}
        self._continued: Mapping[str, str] = {}
        """Files of the run before that are also of this one."""
        self._committing = False

    @property
    def continues(self) -> bool:
        """Whether the run that the folder has is resumed, and not one that was begun in its place."""
        return self.resume and not any(next(self.folder.glob(name + NEW), None) for name in JOURNALS)

    def check_losses(self) -> None:
        """Check that nothing is lost there without leave."""
        run = self.run()
        if run is None or self.replace:
            return
        run.check_format()
        names = _files_in(run.real_path, run.owns)
        if run.kind != self.kind:
            lost = {f", the results of `mrwork {run.kind.verb}`": _entries_of(names)}
        else:
            changed = [] if run.is_as_written or self.continues else [MANIFEST]
            changed += [] if self.continues else filter(partial(_differs, run), run.files)
            lost = {
                ", which other verbs or you have added": _entries_of(filter(is_added, names)),
                ", changed since the run was written": changed,
            }
        if listed := [f"{list_names(names, 10)}{why}" for why, names in lost.items() if names]:
            raise OutputError(
                f"{self.path} has a run; `mrwork {self.kind.verb}` in its place would lose {'; and '.join(listed)}; "
                "choose another folder, or give --replace"
            )

    def run(self) -> RunFolder | None:
        """The run at the destination, `None` for an absent, an empty or an unfinished folder; others are refused."""
        folder = self.folder
        refuse_path_in_run(self.path)
        if not folder.is_dir():
            if exists(folder):
                raise OutputError(f"{self.path} is a file, a run needs a folder; choose another name")
            return None
        if (run := RunFolder.at(folder)) is not None:
            return run
        journals = chain.from_iterable(map(folder.glob, JOURNALS))
        if exists(folder / MANIFEST):
            fault = f"has a {MANIFEST} that is not that of a run of mrwork"
        elif any(map(is_journal, journals)) or not _files_in(
            folder, lambda name: not PurePath(name).match(".*lock")
        ):
            return None
        else:
            fault = f"holds files but no {MANIFEST}, so it is not a run folder"
        raise OutputError(f"{self.path} {fault}, and is left as it is; choose another folder")

    def __enter__(self) -> RunAtWork:
        folder = self.folder
        # Other files are refused before a lock is taken beside them.
        self.run()
        with _explained(self.path):
            folder.mkdir(parents=True, exist_ok=True)
        with ExitStack() as locked:
            locked.callback(_remove_if_empty, folder)
            locked.enter_context(_lock_of(folder))
            for name in ADDITIONS:
                # Refused where a verb is adding it; what a killed verb has left is removed.
                Lock(folder, name).release()
            if (run := self.run()) is not None:
                self._earlier = run.settled()
                self._listed = self._earlier.files
            self.check_losses()
            if self.resume and run is None:
                self.resume = _is_begun(self.path, self._growing_journals(JOURNALS), self._note)
            self._continued = self._listed if self.continues else {}
            if not (self.resume or self.replace):
                _refuse_steps(self.path, self._growing_journals(JOURNALS))
            if not self.resume:
                begun = self.growing(JOURNAL)
                # Last: what an earlier run has left is not taken for a part of this one.
                _sweep(folder, {*self._listed, begun.name})
                with _explained(self.path):
                    _make_empty(begun)
            self._locked = locked.pop_all()
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        for journal in self._journals:
            journal.close()
        if isinstance(error, KeyboardInterrupt):
            error.add_note(_TO_RESUME)
        elif not (self.resume or self._committing) and (
            not self._journals or (error and not any(n_steps(journal.path) for journal in self._journals))
        ):
            _sweep(self.folder, self._listed)
        self._locked.close()

    def journal(self, name: str = JOURNAL) -> Journal:
        """The journal of the run, or of a step of it such as `models/dahl/fit.jsonl`, begun or resumed."""
        growing, committed = self.growing(name), self.folder / name
        if self.resume and not self.replace:
            # A fit has its own journal, a choice one of each step: neither goes on with the other.
            _refuse_steps(
                self.path, self._growing_journals(JOURNALS[1:] if name == JOURNAL else JOURNALS[:1])
            )
        # A step of a comparison that is resumed may not have begun.
        resume = self.resume and (name == JOURNAL or growing.is_file() or committed.is_file())
        journal = journal_in_run(growing, committed=committed, resume=resume, note=self._note)
        self._journals.append(journal)
        return journal

    def _growing_journals(self, patterns: Iterable[str]) -> Iterator[Path]:
        """Journals of the unfinished run, which grow beside a complete one as NAME.new."""
        endings = (NEW,) if self._earlier is not None and self._earlier.is_complete else (NEW, "")
        names = (f"{pattern}{ending}" for pattern in patterns for ending in endings)
        return chain.from_iterable(map(self.folder.glob, names))

    def growing(self, name: str) -> Path:
        """Path at which a file of this run grows, in a folder that is there."""
        return make_folders(self.folder, name if self._earlier is None else name + NEW)

    def grown(self, name: str) -> Path:
        """Path of a file that has grown in this run, or is in the run that is resumed; it need not be there."""
        path = self.growing(name)
        return self.folder / name if name in self._continued and not path.is_file() else path

    @property
    def step_journals(self) -> list[str]:
        """Names of the journals of the steps of a comparison, as far as it has come."""
        names = {path.relative_to(self.folder).as_posix() for path in self.folder.glob(JOURNALS[1] + "*")}
        return sorted({name.removesuffix(NEW) for name in names})

    @property
    def is_as_before(self) -> bool:
        """Whether the run that is resumed was complete, and no step was added to it."""
        complete = self._earlier is not None and self._earlier.is_complete
        return complete and not any(journal.path.is_file() for journal in self._journals)

    def commit(
        self,
        contents: Mapping[str, bytes],
        facts: Mapping[str, object],
        *,
        grown: Collection[str] = (JOURNAL,),
    ) -> None:
        """Write the files of the run, its manifest last, in place of the run before; the folder is then unlocked.

        By path inside the folder: `contents`, and files that have `grown`, of which one that is not there is left out.
        `facts` of the manifest. An interrupted run does not wait until all is on the disk: Ctrl-C returns at once.
        """
        self._committing = True
        for journal in self._journals:
            journal.close()
        with _explained(self.path):
            self.check_losses()
            paths = {name: self.grown(name) for name in grown}
            # A journal without a line only says that the run has begun.
            listed = {
                name: digest_at(name, path)
                for name, path in paths.items()
                if path.is_file() and path.stat().st_size
            }
            replaced: dict[str, str | None] = {}
            if self._earlier is not None:
                # Files of the run before with their digests, and what else has a name of such a file.
                named = {entry.name for entry in self.folder.iterdir() if not entry.is_dir()}
                replaced = dict.fromkeys(named & OWN_NAMES - {MANIFEST}) | dict(self._listed)
            stated, flush = _stated(facts, self.kind), facts.get("status") != INTERRUPTED
            commit(self.folder, stated, contents, grown=listed, replaced=replaced, flush=flush)
            _sweep(self.folder, {**listed, **contents})
        self._locked.close()


def _is_begun(path: Path, journals: Iterator[Path], note: Callable[[str], None]) -> bool:
    """Whether there is a journal to resume; what was killed before its first begins, which is said."""
    if next(journals, None) is not None:
        return True
    note(f"there is nothing to resume in {path}; the run begins")
    return False


def _refuse_steps(path: Path, journals: Iterable[Path]) -> None:
    if steps := sum(map(n_steps, journals)):
        raise JournalError(
            f"{path} has an unfinished run of {counted(steps, 'step')}; run the same command with --resume to "
            "continue it, or with --replace to begin anew"
        )


def _make_empty(path: Path) -> None:
    """Make an empty file, in the place of a link; one that is there is emptied."""
    if path.is_symlink():
        path.unlink()
    os.close(open_to_write(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC))


def _remove_if_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()


def _lock_of(folder: Path) -> Lock:
    # Others hold the lock of a folder for an instant while they add a file.
    for _ in range(100):
        with suppress(JournalError):
            return Lock(folder)
        time.sleep(0.01)
    return Lock(folder)


@contextmanager
def adding(path: str | Path, name: str) -> Iterator[None]:
    """Lock the file `name` that is added to the run folder at `path`, while no run is made there."""
    folder = real_path(path)
    with ExitStack() as locked:
        if (folder / MANIFEST).is_file():
            with _lock_of(folder):
                locked.enter_context(Lock(folder, name))
        yield


@contextmanager
def addition_journal(
    path: str | Path, name: str, *, resume: bool, replace: bool, note: Callable[[str], None]
) -> Iterator[Journal]:
    """The journal of an addition, begun or resumed, to be committed by `add_to_run`; it is locked until then."""
    folder = real_path(path)
    growing, committed = folder / (name + NEW), folder / name
    with adding(folder, name):
        resume = resume and _is_begun(committed, filter(Path.is_file, (growing, committed)), note)
        if not (resume or replace):
            _refuse_steps(committed, [growing])
        journal = journal_in_run(growing, committed=committed, resume=resume, note=note)
        try:
            with closing(journal):
                yield journal
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                error.add_note(_TO_RESUME)
            elif not (resume or n_steps(growing)):
                growing.unlink(missing_ok=True)
            raise


def add_to_run(
    path: str | Path,
    contents: Mapping[str, bytes],
    *,
    grown: Collection[str] = (),
    facts: Mapping[str, object] = MappingProxyType({}),
) -> None:
    """Add files to a run, or write some of them again, by path in its folder; `grown` are there as NAME.new.

    `facts` replace those of the same name in the manifest.
    """
    folder = real_path(path)
    with _lock_of(folder), _explained(path):
        run = RunFolder.open(folder).settled()
        paths = {name: folder / (name + NEW) for name in grown}
        listed = {name: digest_at(name, path) for name, path in paths.items() if path.is_file()}
        replaced = {name: run.files.get(name) for name in (*contents, *listed)}
        stated = _stated({**run.manifest, **facts}, run.kind)
        commit(folder, stated, contents, grown={**run.files, **listed}, replaced=replaced, flush=False)


def with_manifest(
    contents: Mapping[str, bytes], facts: Mapping[str, object], kind: RunKind
) -> dict[str, bytes]:
    """The files of a run with the manifest that lists them, for a folder that is written with others."""
    digests = {name: file_digest(name, content) for name, content in contents.items()}
    return {**contents, MANIFEST: manifest_document({**_stated(facts, kind), FILES: digests})}


def _stated(facts: Mapping[str, object], kind: RunKind) -> dict[str, object]:
    entries = {key: value for key, value in facts.items() if key not in (FILES, OWN)}
    return {**entries, "kind": kind.kind, "verb": kind.verb, "format": FORMAT}


def _sweep(folder: Path, listed: Collection[str]) -> None:
    """Remove what a run that was cut off has left: every NAME.new, and what grows, where they are not `listed`."""
    with suppress(OSError):
        shutil.rmtree(chunks_beside(folder / JOURNAL), ignore_errors=True)
        names = _files_in(folder, lambda name: name.removesuffix(NEW) in OWN_NAMES)
        for name in sorted(names, key=lambda name: name.removesuffix(NEW) == JOURNAL):
            # Journals grow, and histories; a copy that is kept of a changed one is the owner's.
            kind = PurePath(name)
            grows = kind.suffix == ".jsonl" or (kind.suffix == ".nc" and kind.parts[0] == HISTORIES)
            if (name.endswith(NEW) or (grows and name != CHAIN)) and name not in listed:
                (folder / name).unlink(missing_ok=True)
        for name in (HISTORIES, MODELS):
            for path in sorted((folder / name).glob("**"), reverse=True):
                _remove_if_empty(path)


def _explained(path: str | Path) -> AbstractContextManager[None]:
    remedy = "make room, or choose another folder; what was there is untouched"
    return explain_failure(f"write the run to {path}", remedy)
