"""Studies of files and of calls, whose dampers may be fits or run folders: what joins the two wings."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.keys import given_in, keys_of
from mrwork.base.places import Place
from mrwork.base.values import Floats
from mrwork.buildings import Building
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.process_law import ProcessLaw
from mrwork.closed_loop.user_law import Command, UserLaw
from mrwork.control.laws.control_law import ControlLaw
from mrwork.control.laws.law_problem import LawSettings
from mrwork.dampers.tested_range import FittedDamper
from mrwork.errors import SettingError
from mrwork.motions import GroundMotion
from mrwork.store.run_folder import FIT, FIT_RUN, RunFolder
from mrwork.store.run_writer import with_manifest
from mrwork.study import reading
from mrwork.study.dampers import Identified
from mrwork.study.run_options import StudySeed
from mrwork.study.schema import References, StudyTable, TuneTable, UncertaintyTable
from mrwork.study.study import Study

if TYPE_CHECKING:
    from mrwork.identification.fit import Fit


def fitted_damper(run: Path) -> FittedDamper:
    """The fit of a run folder as a study takes it."""
    # Most studies name no run, and the wing of identification takes half as long again to load.
    from mrwork.identification.fit_file import fit_of
    from mrwork.uncertainty.posterior.draws import read_draws

    folder = RunFolder.open(run, FIT_RUN)
    fit = fit_of(folder)

    def draws() -> Floats | None:
        stored_draws = read_draws(folder, fit)
        return None if stored_draws is None else stored_draws.theta

    chosen = replace(_damper_of(fit), draws=draws)
    # Draws of the chosen set only are known.
    others = tuple(
        replace(
            chosen, spec=other.spec, theta=other.theta, draws=partial(np.atleast_2d, np.array(other.theta))
        )
        for other in fit.others
    )
    return replace(chosen, others=others)


@checked
def read_study(
    path: str | Path,
    identified: Identified = fitted_damper,
    *,
    seed: StudySeed = 0,
    on_python: Callable[[str], None] = lambda sentence: None,
) -> Study:
    """Read a study; its laws that lack settings are designed when it runs, or by `mr.study.designed`.

    Parameters
    ----------
    path
        The TOML file; names of other files in it are relative to its folder.
    identified
        Reads model and parameters from the folder of an identified damper.
    on_python
        Called with a sentence that names the file of each law in Python, or the program of one outside of it, before
        any of these runs.

    Raises
    ------
    RecordError
        If the file does not exist or is not text.
    SettingError
        If anything in it is wrong; the message has file and line.
    """
    path = Path(path)
    file, document, place = reading.document_in(path)
    return reading.study_of_tables(document, place, path.parent, identified, seed, on_python, file)


# Names of the arguments by the tables of a study file, where they are others.
_PLURALS = {"damper": "dampers", "controller": "laws", "baseline": "baselines", "motion": "motions"}
_ARGUMENTS = {**{entry.name: entry.name for entry in keys_of(StudyTable)}, **_PLURALS}

Table = Mapping[str, Any]


@checked
def study_of(
    *,
    building: Building | Table,
    motions: Sequence[GroundMotion | str | Path | Table],
    dampers: Sequence[Table] = (),
    laws: Sequence[str | Table | Command | UserLaw | ProcessLaw | ControlLaw] = (),
    baselines: Sequence[Table] = (),
    hardware: Hardware | Table | None = None,
    uncertainty: UncertaintyTable | Table | None = None,
    tune: TuneTable | Table | Sequence[TuneTable | Table] = (),
    places: Table | None = None,
    report: Table | None = None,
    design_level: float | str | None = None,
    target: Table | None = None,
    references: References = "best_passive",
    title: str = "",
    folder: str | Path = "",
    seed: StudySeed = 0,
) -> Study:
    """Make a study, of the same tables as a study file has, see `read_study`.

    A table is a dict with the keys of its table in a file, which ``mrwork help study`` lists. Numbers are in SI,
    or texts with a unit as ``"2 mm"``; arrays may stand for rows of numbers.

    Parameters
    ----------
    building
        A `Building`, or a table, as ``{"n_storeys": 3, "masses": [300], "stiffnesses": [4e5]}``. In a table a
        `Building` may stand for ``file``, with what is built into it.
    motions
        Each a `GroundMotion`, the file of a record, or a table, as ``{"synthetic": "kanai_tajimi", "pga": "0.3 g"}``.
        In a table a `GroundMotion` may stand for ``file``; samples of one's own are
        ``{"acceleration": array, "dt": 0.01}``, shape (n_time,) [m/s2, or its ``unit``; s].
    dampers
        Tables, as ``{"storey": 1, "preset": "kwok2006", "count": 2}``. In the place of ``preset`` stands ``run`` with
        the folder of an identified run, a `Fit`, or what `load` returned.
    laws
        Each the name of a control law, as ``"best_passive"``; a table, as ``{"law": "clipped_optimal", "settings":
        {...}}``; what `own_law` returns; a function of a `LoopSample` and the memory, or a `UserLaw` of one; or a
        `ProcessLaw`. In a table a law of your own or a function may stand for the name.
    baselines
        Tables of the building with other devices, each with ``label`` and ``building``.
    hardware, uncertainty, tune, places, report, target
        Their tables, or a `Hardware`, and one or several `TuneTable`.
    design_level
        Level of the motions on which laws are designed and the best constant command is chosen, where records have
        several: one of their ``pga``, ``sa`` [m/s2, or a text as ``"0.3 g"``] or ``factor``; by default every level.
    references
        What laws are compared with besides i = 0: ``"best_passive"`` or ``"none"``.
    title
        Heading of the page, by default the name of the building.
    folder
        Folder that names of files are relative to, by default the working directory.

    Returns
    -------
    Study
        Ready for `run_study` and `tune`; `Study.to_toml` writes it as a file.

    Raises
    ------
    SettingError
        If anything is wrong with it; the message names the argument.
    RecordError
        If a file that it names cannot be read.

    Examples
    --------
    >>> import mrwork as mr
    >>> study = mr.study_of(
    ...     building=mr.building("uts"),
    ...     dampers=[{"storey": 1, "preset": "kwok2006"}],
    ...     laws=["best_passive", {"law": "inverse_direct", "settings": {"drifts": 1.0, "control_weight": 1e-9}}],
    ...     motions=[mr.synthetic_motion(rng=0, duration=5.0, peak=3.0)],
    ... )
    >>> mr.run_study(study).to_pandas()["peak_drift"].shape
    (4,)
    """
    if isinstance(hardware, Hardware) and hardware.seed:
        raise SettingError(
            f"`hardware` of study_of has the seed {hardware.seed}, and a study has one for all; give it as `seed`"
        )
    stated = {
        "title": title,
        "folder": folder,
        "building": {"file": building} if isinstance(building, Building) else building,
        "damper": [_damper_table(damper) for damper in dampers],
        "controller": [_law_table(law) for law in laws],
        "baseline": baselines,
        "motion": [motion if isinstance(motion, Mapping) else {"file": motion} for motion in motions],
        "design_level": design_level,
        "references": references,
        "hardware": hardware,
        "report": report,
        "uncertainty": uncertainty,
        "tune": [*map(_tune_table, [tune] if isinstance(tune, TuneTable | Mapping) else tune)],
        "places": places,
        "target": target,
    }
    tables = {name: _plain(value) for name, value in stated.items() if value is not None}
    place = Place(origin="study_of", arguments=_ARGUMENTS)
    return reading.study_of_tables(tables, place, Path(), fitted_damper, seed)


def _law_table(law: str | Table | Command | UserLaw | ProcessLaw | ControlLaw) -> Table:
    """The table of a law that is given by its name, by a table, by a function or as a value."""
    if isinstance(law, ProcessLaw):
        return {"process": given_in(law)}
    if isinstance(law, ControlLaw):
        law = {"law": law}
    table: dict[str, Any] = dict(law) if isinstance(law, Mapping) else {"law": law}
    if isinstance(settings := table.get("settings"), LawSettings):
        table["settings"] = given_in(settings)
    if isinstance(law, UserLaw):
        options = {"memory": law.n_memory} | ({} if law.rms_time is None else {"rms_time": law.rms_time})
        table = {"law": law.command, "label": law.name, "user": options}
    if isinstance(own := table.get("law"), ControlLaw):
        del table["law"]
        return {**table, "user": _user_table(own)}
    user = table.get("user", {})
    if callable(table.get("law")) and isinstance(user, Mapping):
        user = {"function": table.pop("law"), **user}
    if isinstance(user, Mapping) and callable(function := user.get("function")):
        name = getattr(function, "__name__", type(function).__name__)
        table["user"] = {**user, "file": function, "function": name}
    return table


def _tune_table(tune: TuneTable | Table) -> TuneTable | Table:
    """The table of a tuning, in which a law of the user may stand for the name of one."""
    laws = tune.get("laws", ()) if isinstance(tune, Mapping) else ()
    own = [law for law in laws if isinstance(law, ControlLaw)] if isinstance(laws, list | tuple) else []
    if isinstance(tune, TuneTable) or not own:
        return tune
    if len(laws) > 1:
        raise SettingError(
            f"{own[0].name} is tuned with other laws in one table; give each law of your own its table"
        )
    return {name: value for name, value in tune.items() if name != "laws"} | {"user": _user_table(own[0])}


def _user_table(law: ControlLaw) -> Table:
    """The table `user` of a law that `own_law` has made."""
    if law.spec.own is None:
        raise SettingError(f"{law.name} is designed already; give its name, and its settings")
    return {"file": law, "law": law.spec.own.name}


def _plain(value: Any) -> Any:
    """A value as the reader of tables takes it: names of files as texts, arrays as lists."""
    if isinstance(value, Mapping):
        return {str(name): _plain(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if hasattr(value, "__array__"):
        array = np.asarray(value)
        return array if array.ndim and array.dtype.kind in "cb" else array.tolist()
    return value


def _damper_table(table: Table) -> Table:
    run = table.get("run")
    if run is None or isinstance(run, str | os.PathLike):
        return table
    # Most studies have no fit, and the wing of identification takes half as long again to load.
    from mrwork.identification.fit import Fit
    from mrwork.runs.load import StoredRun

    if isinstance(run, StoredRun):
        return {**table, "run": run.place.absolute()}
    return {**table, "run": _damper_of(run)} if isinstance(run, Fit) else table


def _damper_of(fit: Fit) -> FittedDamper:
    def files() -> dict[str, bytes]:
        from mrwork.identification.fit_file import fit_content, manifest_of

        return with_manifest({FIT: fit_content(fit)}, manifest_of(fit, fit.status), FIT_RUN)

    return FittedDamper(spec=fit.spec, theta=fit.theta, tested=fit.tested, files=files)
