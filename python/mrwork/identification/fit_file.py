"""Files of a fit: write a run folder, and read the fit back with the tests that it was identified from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from mrwork.errors import RecordError
from mrwork.identification.fit import Fit
from mrwork.records import DamperTest
from mrwork.store.codec import json_document, parse_document, read_document, record_from_json, record_of
from mrwork.store.input_file import is_there, make_stored_kind, text_of
from mrwork.store.output_folder import Destination, write_folder
from mrwork.store.run_folder import FIT, FIT_RUN, JOURNAL, NEAR_SETS, check_manifest, read_kind
from mrwork.store.unfinished import INTERRUPTED

if TYPE_CHECKING:
    from mrwork.records.reading import OnRead

T = TypeVar("T")

# Key of a document that names its fit.
_FIT_OF = "of_fit"


def write_run(
    destination: Destination,
    *,
    fit: Fit,
    manifest: Mapping[str, Any],
    journal: str | Path | None = None,
    documents: Mapping[str, object] | None = None,
    flush: bool = True,
) -> None:
    """Write the run folder of a fit; it replaces an earlier run of the same name, and keeps files of the user.

    `manifest` are facts about the run, `journal` is copied if there is one, `documents` are further JSON documents by
    path inside the folder. `flush`: wait until the files are on the disk, unless the fit was interrupted.
    """
    contents = {name: json_document(document).encode() for name, document in (documents or {}).items()}
    write_folder(
        destination,
        contents | {FIT: fit_content(fit)},
        manifest=manifest,
        copied={} if journal is None else {JOURNAL: Path(journal)},
        # After Ctrl-C the command must return at once; the operating system flushes the files later.
        flush=flush and fit.status != "interrupted",
    )


def fit_content(fit: Fit) -> bytes:
    """The file of a fit in its run folder."""
    return json_document(fit.as_dict()).encode()


def read_fit(path: str | Path) -> Fit:
    """The `Fit` of the run folder at `path`."""
    place = Path(path)
    _, manifest = read_kind(place, FIT_RUN)
    fit = read_document(Fit, place / FIT, name="fit", verb="identify")
    if fit is None:
        raise RecordError(f"{place / FIT} cannot be read (it does not exist); run `mrwork identify` again")
    check_manifest(place, manifest, _facts(fit), file=FIT, verb="identify")
    return fit


def manifest_of(fit: Fit, status: str) -> dict[str, object]:
    """The manifest of a run folder that `mrwork identify` writes: what was identified from what, and how it ended."""
    return {name: values[0] for name, values in _facts(fit).items()} | {"status": status}


def _facts(fit: Fit) -> dict[str, tuple[object, ...]]:
    """Admissible values of each key in the manifest of a fit."""
    return {
        "model": (fit.model,),
        # In an interrupted comparison, the fit itself may be finished.
        "status": (fit.status, INTERRUPTED),
        # Not the fingerprint, which may be another one in a later version.
        "estimates": ({each.name: each.value for each in fit.estimates},),
        "laws": (None if fit.current is None else fit.current.laws,),
        **{name: (value,) for name, value in asdict(fit.provenance).items()},
    }


def addition_content(document: Mapping[str, object], fit: Fit) -> bytes:
    """The file of a document about a fit in its run folder; it names the fit, so that it is not taken for another's."""
    return json_document({_FIT_OF: fit.fingerprint, **document}).encode()


def read_addition(kind: type[T], path: Path, fit: Fit, *, name: str, verb: str) -> T | None:
    """Read a file with an `addition_content`; `None` if there is no such file."""
    file = make_stored_kind(verb, name=f"a {name}")
    if not is_there(path, file):
        return None
    document = parse_document(text_of(path, file), origin=str(path), verb=verb)
    addition: T = record_of(kind, document, origin=str(path), name=name, verb=verb)
    if document.get(_FIT_OF) != fit.fingerprint:
        raise RecordError(f"{path} is of another fit than {FIT} beside it; run `mrwork {verb}` again")
    return addition


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherFits:
    """The file of other fits to the same tests, whose laws predict nearly as well as those of the fit beside it."""

    fits: tuple[Fit, ...]


def others_content(fits: Sequence[Fit], fit: Fit) -> Mapping[str, object]:
    """The document of the other fits in the run folder of a fit."""
    return {_FIT_OF: fit.fingerprint, "fits": [each.as_dict() for each in fits]}


def read_others(place: Path, fit: Fit) -> tuple[Fit, ...] | None:
    """The other fits in the run folder of a fit at `place`, `None` where there are none."""
    name = "list of fits with other laws"
    stored = read_addition(OtherFits, place / NEAR_SETS, fit, name=name, verb="identify")
    if stored is None:
        return None
    units = {each.current.unit for each in (fit, *stored.fits) if each.current is not None}
    if len(units) > 1 or any(each.provenance.inputs != fit.provenance.inputs for each in stored.fits):
        raise RecordError(
            f"{place / NEAR_SETS} has fits to other tests than {FIT} beside it; run `mrwork identify` again"
        )
    return stored.fits


def fit_from_json(text: str, *, origin: str) -> Fit:
    """Undo `json_document(fit.as_dict())`; `origin` names the document in messages."""
    return record_from_json(Fit, text, origin=origin, name="fit", verb="identify")


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenedRun:
    """The fit of a run folder with its tests, cut, repaired and with the observation models of the fit."""

    place: Path
    fit: Fit
    tests: tuple[DamperTest, ...]


def reopen(path: str | Path, *, on_read: OnRead | None = None) -> OpenedRun:
    """Open the run folder at `path`, with the tests it was identified from; `on_read` is called before each."""
    place = Path(path)
    fit = read_fit(place)
    tests = fit.reading(origin=str(place / FIT)).tests(on_read=on_read)
    if len(tests) != len(fit.quality):
        raise RecordError(
            f"{place / FIT} compares {len(fit.quality)} tests where {len(tests)} were read; "
            "run `mrwork identify` again"
        )
    opened = []
    for read, quality in zip(tests, fit.quality, strict=True):
        test = replace(read, observation=quality.observation)
        opened.append(test)
        if test.sha256 not in fit.provenance.inputs.values():
            raise RecordError(
                f"{test.label} has changed since {place} was identified from it; "
                "restore the file, or run `mrwork identify` again"
            )
        if quality.n_time != test.n_counted:
            raise RecordError(
                f"{test.label}: {test.n_counted} samples count where {quality.n_time} did "
                f"when {place} was identified; run `mrwork identify` again with this version"
            )
    return OpenedRun(place=place, fit=fit, tests=tuple(opened))
