"""Files of a fit: write a run folder, and read the fit back with the tests that it was identified from."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mrwork.errors import RecordError
from mrwork.identification.fit import Fit
from mrwork.records import DamperTest
from mrwork.store.codec import json_document
from mrwork.store.run_folder import FIT, FIT_RUN, JOURNAL, NEAR_SETS, RunFolder
from mrwork.store.run_writer import RunAtWork

if TYPE_CHECKING:
    from mrwork.records.reading import OnRead


def write_run(
    work: RunAtWork,
    *,
    fit: Fit,
    manifest: Mapping[str, Any],
    documents: Mapping[str, object] | None = None,
    grown: Collection[str] = (JOURNAL,),
) -> None:
    """Commit the run folder of a fit, in place of an earlier run; files of the user stay.

    `manifest` are facts about the run, `documents` further JSON documents by path inside the folder, `grown` the
    journals that are kept.
    """
    contents = {name: json_document(document).encode() for name, document in (documents or {}).items()}
    work.commit(contents | {FIT: fit_content(fit)}, manifest, grown=grown)


def fit_content(fit: Fit) -> bytes:
    """The fit as the bytes of `fit.json`, without tests and forces."""
    return json_document(fit.as_dict()).encode()


def read_fit(path: str | Path) -> Fit:
    """The `Fit` of the run folder at `path`, which `mrwork identify` has written."""
    return fit_of(RunFolder.open(path, FIT_RUN))


def fit_of(run: RunFolder) -> Fit:
    """The fit of a run folder with the other fits that are as good; refused where `fit.json` is missing."""
    try:
        fit = run.read(Fit, FIT)
    except RecordError:
        if _is_text_of_python(run.document(FIT)):
            raise RecordError(
                f"{run.path / FIT} has the equations of a damper of its user as Python alone, which is no longer run; "
                "run `mrwork identify` again with --model FILE.py:NAME"
            ) from None
        raise
    if fit is None:
        raise RecordError(f"{run.path / FIT} is missing; run `mrwork identify` again")
    stored = run.read(OtherFits, NEAR_SETS)
    return fit if stored is None else replace(fit, others=stored.fits)


def _is_text_of_python(document: Mapping[str, Any]) -> bool:
    """Whether the model of a fit has names of functions in place of tapes, as before there were tapes."""
    spec = document.get("own")
    own = spec.get("own") if isinstance(spec, Mapping) else None
    return isinstance(own, Mapping) and isinstance(own.get("force"), str)


def manifest_of(fit: Fit, status: str) -> dict[str, object]:
    """The manifest of a run folder that `mrwork identify` writes: what was identified from what, and how it ended."""
    return {
        "model": fit.model,
        "status": status,
        "estimates": {estimate.name: estimate.value for estimate in fit.estimates},
        "laws": None if fit.current is None else fit.current.laws,
        **asdict(fit.provenance),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherFits:
    """The file of other fits to the same tests, whose laws predict nearly as well as the fit beside it."""

    fits: tuple[Fit, ...]


def others_content(fits: Sequence[Fit]) -> Mapping[str, object]:
    """The document of the other fits in the run folder of a fit."""
    return {"fits": [fit.as_dict() for fit in fits]}


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenedRun:
    """The fit of a run folder with its tests, cut, repaired and with the observation models of the fit."""

    run: RunFolder
    fit: Fit
    tests: tuple[DamperTest, ...]


def reopen(path: str | Path, *, on_read: OnRead | None = None) -> OpenedRun:
    """Open the run folder at `path`, with the tests it was identified from; `on_read` is called before each."""
    run = RunFolder.open(path, FIT_RUN)
    fit = fit_of(run)
    tests = fit.reading(origin=str(run.path / FIT)).tests(on_read=on_read)
    if len(tests) != len(fit.quality):
        raise RecordError(
            f"{run.path / FIT} compares {len(fit.quality)} tests where {len(tests)} were read; "
            "run `mrwork identify` again"
        )
    opened = []
    for read, quality in zip(tests, fit.quality, strict=True):
        test = replace(read, observation=quality.observation)
        opened.append(test)
        if test.sha256 not in fit.provenance.inputs.values():
            raise RecordError(
                f"{test.label} has changed since {run.path} was identified from it; "
                "restore the file, or run `mrwork identify` again"
            )
        if quality.n_time != test.n_counted:
            raise RecordError(
                f"{test.label}: {test.n_counted} samples count where {quality.n_time} did "
                f"when {run.path} was identified; run `mrwork identify` again with this version"
            )
    return OpenedRun(run=run, fit=fit, tests=tuple(opened))
