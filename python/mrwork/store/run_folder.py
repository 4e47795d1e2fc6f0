"""Folder of a run: names of its files, the verbs that write one, how files are committed to it, and how it is opened.

The manifest lists every file of the run with its digest. A file with this digest is trusted as it is; any other is
refused. Every reader of a folder opens it as `RunFolder`; modules of types define the contents of files.

Files are written as NAME.new, the manifest lists them, then each gets its name. Until the manifest is replaced the
folder has what was there before, afterwards the new files: `end_commit` gives a folder whose commit was cut off the
rest of its names. A file that is replaced, and is not as it was written, was changed by its owner, and becomes NAME~.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from typing import Any, Final, TypeVar

from mrwork.base.summary import list_names
from mrwork.errors import MrworkError, OutputError, RecordError
from mrwork.store.codec import built, json_document
from mrwork.store.input_file import bytes_of, exists, is_file, is_folder, is_there, make_stored_kind, text_of
from mrwork.store.output_file import Lock, new_file

MANIFEST: Final = "manifest.json"
NEW: Final = ".new"
"""Ending of a file that is written beside a manifest, until a manifest lists it."""
FILES, REPLACED, OWN = "files", "replaced", "digest"
"""Keys of a manifest: digests of the files by name; of those before, until each file has its name; its own digest."""
_TEXTS: Final = frozenset({".json", ".jsonl", ".toml", ".csv", ".html", ".svg"})

JOURNAL = "journal.jsonl"
REPORT = "report.html"
SUMMARY = "summary.html"
"""The front of the page alone."""
DATA = "data"
"""Folder of CSV files with what the figures of the page draw."""
FIGURES = "figures"
FIT = "fit.json"
# Added to the folder of a fit by later verbs.
CHAIN = "posterior.jsonl"
DRAWS = "posterior.nc"
PROFILES = "profiles.json"
PLAN = "plan.json"
CALIBRATION = "calibration.json"
FOLDS = "left_out"
PREDICTIONS = "predictions.npz"
HELD_OUT = "held_out.json"
HELD_OUT_FORCES = "held_out.npz"
# Added by a choice of model or laws: the ranking, a folder with the fit of each model, and the fits of other sets of
# laws that predict nearly as well.
RANKING = "ranking.json"
MODELS = "models"
NEAR_SETS = "near_sets.json"
# Written by a study of buildings.
RESULTS = "results.json"
STUDY = "study.toml"
# Quantities and criteria of the runs of a study.
RUNS = "runs.nc"
HISTORIES = "histories"
CRITERIA_TABLE = "criteria.csv"
PROFILES_TABLE = "profiles.csv"
# With --ensemble: its verdicts and criteria for each set of laws.
ENSEMBLE = "ensemble.json"
# Written by a tuning.
CHOSEN = "chosen.toml"
"""The study with the chosen settings, for `mrwork respond`."""
SCORES_TABLE = "scores.csv"
TUNED = "tuned.json"

INTERRUPTED: Final = "interrupted"
"""Status in the manifest of a run that was written before its end."""
T = TypeVar("T")

FORMAT: Final = 5
"""Increased whenever the files of a run folder change in a way that this version cannot read."""
ADDITIONS: Final = frozenset({
    CHAIN, DRAWS, PROFILES, PLAN, CALIBRATION, FOLDS, PREDICTIONS, HELD_OUT, HELD_OUT_FORCES,
})  # fmt: skip
"""What later verbs add to the folder of a fit."""
REDRAWN: Final = frozenset({REPORT, SUMMARY, DATA})
"""What later verbs write again, from the other files."""
OWN_NAMES: Final = ADDITIONS | REDRAWN | {
    MANIFEST, JOURNAL, FIGURES, FIT, RANKING, MODELS, NEAR_SETS, RESULTS, STUDY, RUNS, HISTORIES,
    CRITERIA_TABLE, PROFILES_TABLE, ENSEMBLE, CHOSEN, SCORES_TABLE, TUNED,
}  # fmt: skip
"""Names in a run folder that verbs use; all others are the user's."""
JOURNALS: Final = (JOURNAL, f"{MODELS}/**/*.jsonl")
"""Patterns of the journals that grow while a run is made: of the run, and of the steps of a choice.

The first is there from the beginning of any run, still empty, and tells its folder from one of other files.
"""


def is_added(name: str) -> bool:
    """Whether a file of a run is one that later verbs add, or that one of them is at work on."""
    return name.partition("/")[0].removesuffix(NEW) in ADDITIONS | {FIGURES}


@dataclass(frozen=True, slots=True, kw_only=True)
class RunKind:
    """Kind of run folder that a verb writes, with its `kind` in the manifest."""

    verb: str
    kind: str


FIT_RUN: Final = RunKind(verb="identify", kind="identification")
STUDY_RUN: Final = RunKind(verb="respond", kind="study")
TUNING_RUN: Final = RunKind(verb="tune", kind="tuning")
RUN_KINDS: Final = (FIT_RUN, STUDY_RUN, TUNING_RUN)


def real_path(path: str | Path) -> Path:
    """Path with symbolic links resolved, so that writing replaces the target."""
    return Path(os.path.realpath(path))


def chunks_beside(journal: Path) -> Path:
    """Folder of the finished chunks of the step that a journal does not have yet."""
    return journal.with_name(f"{journal.name.removesuffix(NEW)}.chunks")


def file_digest(name: str, content: bytes) -> str:
    """Digest of the content of a file; of a text it does not depend on how lines end, which some programs change."""
    whole = content.replace(b"\r\n", b"\n") if PurePath(name).suffix in _TEXTS else content
    return f"sha256:{hashlib.sha256(whole).hexdigest()}"


def digest_at(name: str, path: Path) -> str:
    """Digest of a file that has, or will have, a name."""
    return file_digest(name, path.read_bytes())


def digest_of_manifest(stated: Mapping[str, object]) -> str:
    """Digest of what a manifest states, without itself."""
    facts = {key: value for key, value in stated.items() if key != OWN}
    return file_digest(MANIFEST, json_document(facts).encode(errors="surrogatepass"))


def manifest_document(stated: Mapping[str, object]) -> bytes:
    """The content of a manifest that states this, and its own digest."""
    return json_document({**stated, OWN: digest_of_manifest(stated)}).encode()


def make_folders(folder: Path, name: str) -> Path:
    """Make the folders of the file `name` in `folder`, none of which is a link; return its path."""
    if PurePath(name).is_absolute() or ".." in PurePath(name).parts:
        # A manifest that somebody else has written leads nowhere else.
        raise OutputError(f"the {MANIFEST} of {folder} lists {name}, which is outside that folder")
    path = folder / name
    for above in reversed([parent for parent in path.parents if folder in parent.parents]):
        if above.is_symlink():
            raise OutputError(
                f"{above} is a symbolic link, which mrwork does not follow; put a folder in its place"
            )
        above.mkdir(exist_ok=True)
    return path


def commit(
    folder: Path,
    stated: Mapping[str, object],
    contents: Mapping[str, bytes],
    *,
    grown: Mapping[str, str],
    replaced: Mapping[str, str | None],
    flush: bool,
) -> None:
    """Write files into a folder with a manifest, in place of those before.

    `stated`: facts of the manifest. By name: `contents`; digests of files that have `grown` there, which NAME.new or
    NAME has; digests of the files that are `replaced`, of which those that are not written go. `flush`: whether to wait
    until the contents are on the disk.
    """
    files = dict(grown)
    for name, content in contents.items():
        files[name] = file_digest(name, content)
        _write(folder, name + NEW, content, flush=flush)
    manifest = {**stated, FILES: files, REPLACED: replaced}
    _replace_manifest(folder, manifest)
    end_commit(folder, manifest)


def end_commit(folder: Path, manifest: Mapping[str, Any]) -> dict[str, Any]:
    """Give the files of a manifest their names, and remove those before; return the manifest that says so."""
    files, replaced = manifest[FILES], manifest[REPLACED]
    for name, digest in files.items():
        path, beside = make_folders(folder, name), make_folders(folder, name + NEW)
        if beside.is_file() and digest_at(name, beside) == digest:
            _keep_changed(path, name, replaced)
            beside.replace(path)
    for name in replaced:
        if name not in files:
            _keep_changed(path := make_folders(folder, name), name, replaced)
            path.unlink(missing_ok=True)
            with suppress(OSError):
                # A folder that is empty now; the folder of the run has a manifest.
                path.parent.rmdir()
    ended = {key: value for key, value in manifest.items() if key not in (REPLACED, OWN)}
    _replace_manifest(folder, ended)
    return {**ended, OWN: digest_of_manifest(ended)}


def _keep_changed(path: Path, name: str, replaced: Mapping[str, str | None]) -> None:
    """Keep a file that its owner has changed as NAME~."""
    if path.is_symlink() or (path.is_file() and digest_at(name, path) != replaced.get(name)):
        backup = path.with_name(f"{path.name}~")
        while exists(backup):
            backup = backup.with_name(f"{backup.name}~")
        path.rename(backup)


def _replace_manifest(folder: Path, stated: Mapping[str, object]) -> None:
    _write(folder, MANIFEST + NEW, manifest_document(stated), flush=True)
    (folder / (MANIFEST + NEW)).replace(folder / MANIFEST)


def _write(folder: Path, name: str, content: bytes, *, flush: bool) -> None:
    with new_file(make_folders(folder, name)) as stream:
        stream.write(content)
        if flush:
            stream.flush()
            os.fsync(stream.fileno())


_reads_changed: ContextVar[bool] = ContextVar("_reads_changed", default=False)


@contextmanager
def reading_changed(accepted: bool = True) -> Iterator[None]:
    """Read the files of run folders in the block also where they are not as a verb has written them."""
    token = _reads_changed.set(accepted)
    try:
        yield
    finally:
        _reads_changed.reset(token)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunFolder:
    """A run folder opened by its manifest; `path` is its name as the user gives it."""

    path: Path
    kind: RunKind
    manifest: Mapping[str, Any]

    @classmethod
    def open(cls, path: str | Path, wanted: RunKind | None = None) -> RunFolder:
        """The run folder at `path`, which must be of the kind `wanted`, by default of any."""
        folder = Path(path)
        kinds = (wanted,) if wanted else RUN_KINDS
        verbs = [f"`mrwork {kind.verb}`" for kind in kinds]
        give = f"give a folder that {' or '.join(verbs)} has written"
        if not (is_folder(folder) and exists(folder / MANIFEST)):
            raise RecordError(_no_run(folder, give))
        run = cls.at(folder)
        if run is None:
            raise RecordError(f"the {MANIFEST} of {folder} is not that of a run of mrwork; {give}")
        if run.kind not in kinds:
            raise RecordError(
                f"{folder} is a run of `mrwork {run.kind.verb}`, where one of {verbs[0]} was expected; give the folder "
                "of one, or read this one back with `mr.load`"
            )
        run.check_format()
        if not (run.is_as_written or _reads_changed.get()):
            raise RecordError(_not_as_written(folder / MANIFEST, run.kind.verb))
        if REPLACED in run.manifest:
            # Another process may be ending the commit, or the folder be one that cannot be written.
            with suppress(MrworkError, OSError), Lock(run.real_path):
                return run.settled()
        return run

    @classmethod
    def at(cls, path: Path) -> RunFolder | None:
        """The run in a folder of any format; `None` where there is no manifest, or another program wrote it."""
        manifest = path / MANIFEST
        if not exists(manifest):
            return None
        try:
            stated = json.loads(text_of(manifest, make_stored_kind("identify", name="the manifest")))
        except ValueError as reason:
            raise OutputError(
                f"{manifest} is not JSON ({reason}); restore it, or choose another folder"
            ) from None
        for kind in RUN_KINDS if isinstance(stated, Mapping) else ():
            if (stated.get("verb"), stated.get("kind")) == (kind.verb, kind.kind):
                return cls(path=path, kind=kind, manifest=stated)
        return None

    @property
    def real_path(self) -> Path:
        """The folder, without links."""
        return real_path(self.path)

    @property
    def files(self) -> Mapping[str, str]:
        """Digest of every file of the run, but for the manifest, by its path in the folder."""
        listed: Mapping[str, str] = self.manifest.get(FILES, {})
        return listed

    @property
    def is_as_written(self) -> bool:
        """Whether the manifest itself is as a verb has written it."""
        return self.manifest.get(OWN) == digest_of_manifest(self.manifest)

    def settled(self) -> RunFolder:
        """The run with all its files by their names; the folder must be locked."""
        run = RunFolder.at(self.path)
        if run is None or REPLACED not in run.manifest:
            return run or self
        return replace(run, manifest=end_commit(run.real_path, run.manifest))

    def check_format(self) -> None:
        """Refuse a folder in another format."""
        if (version := self.manifest.get("format")) != FORMAT:
            raise RecordError(
                f"{self.path} was written by another version of mrwork (format {version}, not {FORMAT}); "
                f"run `mrwork {self.kind.verb} ... --out {self.path} --replace` again"
            )

    @property
    def is_complete(self) -> bool:
        """Whether the run was not interrupted."""
        return self.manifest.get("status") != INTERRUPTED

    def owns(self, name: str) -> bool:
        """Whether a name in the folder is of the run, or one that later verbs use."""
        return name.removesuffix(NEW) in OWN_NAMES | {file.partition("/")[0] for file in self.files}

    def file(self, name: str) -> Path:
        """Path of a file of the run, which does not have its name yet where a commit was cut off."""
        beside = self.path / (name + NEW)
        return beside if REPLACED in self.manifest and exists(beside) else self.path / name

    def content(self, name: str, *, verb: str = "") -> bytes | None:
        """Content of a file, `None` where there is none; refused where it is not as its `verb` has written it."""
        path, verb = self.file(name), verb or self.kind.verb
        file = make_stored_kind(verb)
        if not is_there(path, file):
            return None
        content = bytes_of(path, file)
        if file_digest(name, content) == self.files.get(name) or _reads_changed.get():
            return content
        raise RecordError(_not_as_written(self.path / name, verb))

    def document(self, name: str, *, verb: str = "") -> Any:
        """The value of a JSON file, as `content`; `None` where there is none."""
        content = self.content(name, verb=verb)
        return None if content is None else json.loads(content.decode())

    def read(self, kind: type[T], name: str, *, verb: str = "") -> T | None:
        """The value of this type in a JSON file, as `content`; `None` where there is none."""
        with self.explained(name, verb=verb):
            document = self.document(name, verb=verb)
            return None if document is None else built(kind, document)

    @contextmanager
    def explained(self, name: str, *, verb: str = "") -> Iterator[None]:
        """Say of a file that was changed, and is read as it is, why it cannot be, and which `verb` writes it."""
        try:
            yield
        except MrworkError:
            raise
        except Exception as reason:  # whatever a changed value leads to
            raise RecordError(
                f"{self.path / name} cannot be read ({type(reason).__name__}: {reason}); restore it, or run "
                f"`mrwork {verb or self.kind.verb}` again"
            ) from None


def refuse_path_in_run(path: Path) -> None:
    """Check that what is written at `path` is no part of a run that lies in a folder above it."""
    real = real_path(path.parent) / path.name
    for folder in real.parents:
        run = None
        # A damaged manifest may belong to any program.
        with suppress(MrworkError):
            run = RunFolder.at(folder)
        if run is not None and run.owns(real.relative_to(folder).parts[0]):
            raise OutputError(f"{path} belongs to the run in {folder}; give another name")


def check_output(path: Path, *, replace: bool, otherwise: str) -> None:
    """Check that the file that a user names can be written: none is there, or one of the user's that is to be replaced.

    `otherwise`: what else to do than to choose another name.
    """
    if is_folder(path):
        raise OutputError(f"{path} is a folder; give the name of a file")
    if not replace and (exists(path) or os.path.islink(path)):  # noqa: PTH114 - `Path.is_symlink` raises for some names
        raise OutputError(f"{path} is there already; choose another name, or {otherwise}")
    refuse_path_in_run(path)


def _not_as_written(path: Path, verb: str) -> str:
    return (
        f"{path} is not as mrwork has written it; run `mrwork {verb}` again, restore the file, or read it as it is "
        "with --changed (in Python mr.load(..., changed=True))"
    )


def _no_run(path: Path, give: str) -> str:
    """Why what is at `path` is no run folder, and what to give instead."""
    for around in path.parents[:2]:
        if exists(path) and RunFolder.at(around):
            return f"{path} is a part of the run {around}; give that folder"
    if not exists(path):
        return f"{path} does not exist; {give}"
    if not is_folder(path):
        return f"{path} is a file; {give}"
    if any(next(path.glob(pattern), None) for pattern in JOURNALS):
        return f"{path} has an unfinished run; run the command that began it again with --resume"
    if runs := sorted(found.parent.name for found in path.glob(f"*/{MANIFEST}") if is_file(found)):
        return f"{path} holds runs and is none itself; give one of {list_names(runs, 5)} in it"
    return f"{path} is not a run folder, it has no {MANIFEST}; {give}"
