"""`mr.export`: a run for MATLAB, for OpenSees, for a rig, or as a table; `mrwork export` calls the same."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from io import BytesIO
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.labelled import NamedArray, NamedArrays
from mrwork.embedded.c_source import CSource, Flavour
from mrwork.errors import MrworkError, MrworkWarning, SettingError
from mrwork.identification.fit import Fit, FitQuality
from mrwork.identification.fit_file import reopen
from mrwork.records.columns import StatedCommand
from mrwork.runs.damper_text import force_table, opensees_text
from mrwork.runs.load import read_run
from mrwork.runs.printed import controller_of_study, damper_of_fit, files_of, write_files
from mrwork.runs.wanted import Command, Error, Example, Law, Libm, Single, Target, TimeStep, Wanted
from mrwork.store.output_file import write_file
from mrwork.store.run_folder import check_output
from mrwork.study.results import StudyResults
from mrwork.uncertainty.bands.predictions import predict


@checked
def export(
    run: str | Path | Fit | StudyResults,
    to: Target,
    output: str | Path,
    *,
    command: Command = None,
    error: Error = None,
    time_step: TimeStep = None,
    libm: Libm = False,
    single: Single = False,
    law: Law = None,
    example: Example = False,
    replace: bool = False,
) -> Path:
    """Write a fit, a study or a tuning in the form of another program, in SI.

    - ``mat``: for MATLAB, of a fit its parameters, laws and, where its tests can be read, their measured and simulated
      forces; of a study or a tuning every array. Each has its unit and words beside it; names that MATLAB does not
      take are changed, and stand beside, too.
    - ``opensees``: a Bouc-Wen damper at one command as materials of OpenSees, in Tcl, or in Python for openseespy where
      the name of the file ends with ``.py``, with the strain step and time step that keep the wanted error.
    - ``csv``: of a fit its force over velocity and command, in harmonic tests of the largest tested stroke; of a study
      or a tuning its criteria, one run a row.
    - ``c``: of a fit its damper in C99 for a rig or another simulation, in a folder whose name begins every name of the
      code: NAME.h, NAME.c with ``NAME_start`` and ``NAME_step``, and NAME_check.c, a program that checks them. Of a
      study file the controller of a law, with its observer.
    - ``fmu``: the same as functional mock-up units, with their sources and, where there is a C compiler, a binary:
      NAME.fmu of FMI 2.0, for model exchange and co-simulation, and NAME_fmi3.fmu of FMI 3.0, for co-simulation.

    Parameters
    ----------
    run
        Folder of a run, or what `identify`, `run_study` or `mr.tuning.judge` returned; for a controller a study file.
        Tests are read for a folder only.
    to
        The other program.
    output
        The file to write, of C and FMUs the folder.
    replace
        Whether a file that is there is replaced.

    Raises
    ------
    SettingError
        Where the target does not take the run, as OpenSees a damper other than Bouc-Wen, or a fit with a parameter on
        a bound that was given; the bounds of the model are part of it. Where C would need too many sub-steps.
    OutputError
        Where the file is there already, is no ordinary one, belongs to a run, or cannot be written.

    Examples
    --------
    >>> import mrwork as mr
    >>> mr.export("out/rig", "opensees", "damper.tcl", command="0.5 A", error=0.01)  # doctest: +SKIP
    """
    path = Path(output)
    wanted = Wanted(
        to=to,
        command=command,
        error=error,
        time_step=time_step,
        libm=libm,
        single=single,
        law=law,
        example=example,
    )
    if to in ("c", "fmu"):
        write_files(path, files_of(printed(run, wanted, path), to), replace=replace)
        return path
    check_output(path, replace=replace, otherwise="replace it by `--replace`, in Python `replace=True`")
    write_file(path, exported(run, wanted, tcl=path.suffix != ".py"))
    return path


def printed(run: str | Path | Fit | StudyResults, wanted: Wanted, folder: Path) -> CSource:
    """The code that `export` writes to a folder, which it is named after."""
    name, flavour = folder.absolute().name, Flavour(libm=wanted.libm, single=wanted.single)
    if isinstance(run, str | Path) and Path(run).is_file():
        if wanted.time_step is not None:
            raise SettingError(
                "the sample time of a controller is that of its hardware; leave the time step out"
            )
        return controller_of_study(Path(run), name, flavour, wanted.law, example=wanted.example)
    opened = read_run(Path(run)) if isinstance(run, str | Path) else run
    if not isinstance(opened, Fit):
        raise SettingError(
            "a run of a study or a tuning is not printed as C; give the run folder of mrwork identify for a damper, or "
            "the study file for a controller"
        )
    if wanted.example:
        raise SettingError("the example is a program around a controller; leave it out, or give a study file")
    if wanted.law is not None:
        raise SettingError("a fit has no control law; leave the law out, or give a study file")
    return damper_of_fit(opened, name, flavour, wanted.time_step)


def exported(run: str | Path | Fit | StudyResults, wanted: Wanted, *, tcl: bool) -> bytes:
    """Content of the file that `export` writes."""
    to, error, time_step = wanted.to, wanted.error, wanted.time_step
    stated = None if wanted.command is None else StatedCommand.of(wanted.command)
    opened = read_run(Path(run)) if isinstance(run, str | Path) else run
    if isinstance(opened, Fit):
        if to == "mat":
            return _matlab_of_fit(opened, Path(run) if isinstance(run, str | Path) else None)
        if to == "csv":
            return force_table(opened, stated).encode()
        return opensees_text(opened, stated, error=error, time_step=time_step, tcl=tcl).encode()
    if to == "opensees" or stated is not None:
        raise SettingError(
            "a study or a tuning has no single damper to export at a command; give the run folder of mrwork identify"
        )
    if to == "csv":
        table = opened.to_pandas()
        named = {name: f"{name} [{unit}]" for name, unit in table.attrs["units"].items()}
        text: str = table.rename(columns=named).reset_index().to_csv(index=False, lineterminator="\n")
        return text.encode()
    groups = {name: _group(group) for name, group in opened._named_groups().items()}
    return _file({"title": opened.title, **_rename_keys(groups)})


# A MATLAB file of version 5: structs whose arrays have their unit and words beside them.
_LONGEST_NAME = 63
# MATLAB's `iskeyword`.
_KEYWORDS = frozenset({
    "break", "case", "catch", "classdef", "continue", "else", "elseif", "end", "for", "function", "global", "if",
    "otherwise", "parfor", "persistent", "return", "spmd", "switch", "try", "while",
})  # fmt: skip


def matlab_names(names: Iterable[str]) -> dict[str, str]:
    """Valid and distinct MATLAB name of each name: letters, digits and underscores, first a letter, at most 63."""
    valid_names: dict[str, str] = {}
    for name in names:
        valid = re.sub(r"[^A-Za-z0-9_]", "_", name)
        if not re.match(r"[A-Za-z]", valid) or valid in _KEYWORDS:
            valid = f"x{valid}"
        ends = chain([""], (f"_{number}" for number in count(2)))
        distinct = (f"{valid[: _LONGEST_NAME - len(end)]}{end}" for end in ends)
        valid_names[name] = next(other for other in distinct if other not in valid_names.values())
    return valid_names


def _matlab_of_fit(fit: Fit, path: Path | None) -> bytes:
    spec = fit.spec
    parameters = {
        estimate.name: {
            key: np.nan if value is None else value
            for key, value in asdict(estimate).items()
            if key != "interval"
        }
        for estimate in fit.estimates
    }
    content: dict[str, Any] = {
        "title": f"Fit of {fit.model}",
        "model": fit.model,
        "equation": spec.equations,
        "status": fit.status,
        "fit_percent": fit.fit_percent,
        "rmse": {"value": fit.rmse_n, "unit": "N"},
        "observation": fit.observation_in_words,
        "tested": fit.tested.in_words,
        "remarks": _cells([remark.in_words for remark in fit.remarks]),
        "theta": np.array(fit.theta),
        "theta_names": _cells(spec.names),
        "theta_units": _cells([parameter.unit for parameter in spec.parameters]),
        "parameters": _rename_keys(parameters),
    }
    if spec.command_unit is not None:
        laws = {
            plain.name: {
                "law": str(law),
                "parameters": _cells(
                    [parameter.name for parameter in spec.parameters if parameter.plain_name == plain.name]
                ),
            }
            for plain, law in spec.law_pairs
        }
        content["laws"] = _rename_keys(laws)
        content["command_unit"] = spec.command_unit
        content["interpolation"] = (
            "A law by values goes on along its tangents beyond its commands; every parameter that follows the command "
            "is limited to the admissible range of the model."
        )
    content["tests"] = _cells([*map(_as_recorded, fit.quality)]) if path is None else _tests(path)
    return _file(content)


def _as_recorded(quality: FitQuality) -> dict[str, Any]:
    """What was applied to the model's force on a test, in the order of the fields: numbers, and words."""
    return {
        "name": quality.test,
        "words": quality.recorded_in_words,
        "observation": asdict(quality.observation),
        "estimated": asdict(quality.estimated),
    }


def _tests(path: Path) -> Any:
    try:
        opened = reopen(path)
    except MrworkError as reason:
        warnings.warn(f"the file has no tests with their forces: {reason}", MrworkWarning, stacklevel=5)
        return _cells([])
    predictions = predict(opened.fit, opened.tests).predictions
    return _cells(
        [
            {**_as_recorded(quality), "name": prediction.test.label, **_group(prediction._named_arrays())}
            for prediction, quality in zip(predictions, opened.fit.quality, strict=True)
        ]
    )


def _group(arrays: NamedArrays) -> dict[str, Any]:
    labels = {name: _array(name, label, ()) for name, label in arrays.labels.items()}
    data = {
        name: _array(name, array, array.axes) for name, array in {**arrays.along, **arrays.arrays}.items()
    }
    return {"title": arrays.title, "labels": _rename_keys(labels), **_rename_keys(data)}


def _array(name: str, array: NamedArray, axes: tuple[str, ...]) -> dict[str, Any]:
    values = array.values
    texts = values.dtype.kind not in "biuf"
    struct: dict[str, Any] = {
        "name": name,
        "values": _cells(values) if texts else values,
        "unit": array.unit,
        "words": array.long_name,
    }
    return {**struct, "axes": _cells(axes)} if axes else struct


def _rename_keys(content: Mapping[str, Any]) -> dict[str, Any]:
    return {valid: content[name] for name, valid in matlab_names(content).items()}


def _cells(values: Any) -> Any:
    """A cell array, of the shape of an array, or a column of a list."""
    if isinstance(values, np.ndarray):
        return values.astype(object)
    cells = np.empty(len(values), dtype=object)
    cells[:] = list(values)
    return cells


def _file(content: Mapping[str, Any]) -> bytes:
    # A quarter of a second.
    from scipy.io import savemat

    stream = BytesIO()
    savemat(
        stream,  # type: ignore[arg-type] # the stubs know no streams
        dict(content),
        long_field_names=True,
        oned_as="column",
        do_compression=True,
    )
    return stream.getvalue()
