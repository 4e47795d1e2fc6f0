"""`mr.export`: a run as a file for MATLAB, for OpenSees, or as a table; `mrwork export` calls the same."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, assert_never

from mrwork.base.arguments import checked
from mrwork.dampers.conversions import OpenSeesError, OpenSeesTimeStep
from mrwork.errors import SettingError
from mrwork.identification.fit import Fit
from mrwork.records.columns import StatedCommand
from mrwork.runs.damper_text import force_table, opensees_damper
from mrwork.runs.load import read_run
from mrwork.runs.matlab_file import matlab_of_fit, matlab_of_groups
from mrwork.store.output_file import replacing
from mrwork.store.output_folder import check_output
from mrwork.study.results import StudyCriteria
from mrwork.tuning.results import TuningResults

Target = Literal["mat", "opensees", "csv"]

# Which of the options belong to a target, of a fit; those of a study or a tuning have none.
_OPTIONS: dict[Target, tuple[str, ...]] = {
    "mat": (),
    "opensees": ("command", "error", "time_step"),
    "csv": ("command",),
}
_PYTHON = ".py"


@checked
def export(
    run: str | Path | Fit | StudyCriteria | TuningResults,
    to: Target,
    output: str | Path,
    *,
    command: str | None = None,
    error: OpenSeesError | None = None,
    time_step: OpenSeesTimeStep | None = None,
    replace: bool = False,
) -> Path:
    """Write a fit, a study or a tuning in the form of another program, in SI.

    - ``mat``: for MATLAB, of a fit its parameters, laws and, where its tests can be read, their measured and simulated
      forces; of a study or a tuning every array. Each has its unit and words beside it; names that MATLAB does not
      take are changed, and stand beside, too.
    - ``opensees``: a Bouc-Wen damper at one command as materials of OpenSees, in Tcl, or in Python for openseespy where
      the name of the file ends with ``.py``, with the strain step and time step that keep the wanted error.
    - ``csv``: of a fit its force over velocity and command, in harmonic tests of the largest tested stroke; of a study
      or a tuning its criteria or scores, one run a row.

    Parameters
    ----------
    run
        Folder of a run, or what `identify`, `run_study` or `tune` returned. Tests are read for a folder only.
    to
        The other program.
    output
        The file to write.
    command
        Command at which the damper is exported, with its unit, as in ``"0.5 A"``.
    error
        Wanted error of BoucWen in OpenSees, a share of the largest force of the loop; default 0.005.
    time_step
        Step [s] of the analysis in OpenSees, of which sub-steps are told; default 0.001.
    replace
        Whether a file that is there is replaced.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    SettingError
        Where the target does not take the run, as OpenSees a damper other than Bouc-Wen, or a fit with a parameter on
        its bound.
    OutputError
        Where the file is there already, is no ordinary one, belongs to a run, or cannot be written.

    Examples
    --------
    >>> import mrwork as mr
    >>> mr.export("out/rig", "opensees", "damper.tcl", command="0.5 A", error=0.01)  # doctest: +SKIP
    """
    place = Path(output)
    check_output(place, replace=replace, otherwise="replace it by `--replace`, in Python `replace=True`")
    content = exported(
        run,
        to,
        command=command,
        error=error,
        time_step=time_step,
        language="python" if place.suffix == _PYTHON else "tcl",
    )
    with replacing(place) as stream:
        stream.write(content)
    return place


def exported(
    run: str | Path | Fit | StudyCriteria | TuningResults,
    to: Target,
    *,
    command: str | None,
    error: float | None,
    time_step: float | None,
    language: Literal["tcl", "python"],
) -> bytes:
    """Content of the file that `export` writes."""
    given = {"command": command, "error": error, "time_step": time_step}
    for name, value in given.items():
        if value is not None and name not in _OPTIONS[to]:
            takes = [each for each, names in _OPTIONS.items() if name in names]
            raise SettingError(
                f"the {name.replace('_', ' ')} is only for an export to {' or '.join(takes)}; leave it out"
            )
    stated = None if command is None else StatedCommand.of(command)
    opened = read_run(Path(run)) if isinstance(run, str | Path) else run
    if isinstance(opened, Fit):
        match to:
            case "mat":
                return matlab_of_fit(opened, Path(run) if isinstance(run, str | Path) else None)
            case "csv":
                return force_table(opened, stated).encode()
            case "opensees":
                damper = opensees_damper(opened, stated, error=error, time_step=time_step)
                return (damper.python if language == "python" else damper.tcl).encode()
            case _:
                assert_never(to)
    if to == "opensees" or stated is not None:
        raise SettingError(
            "a study or a tuning has no single damper to export at a command; give the run folder of mrwork identify"
        )
    if to == "csv":
        table = opened.to_pandas()
        units = table.attrs["units"]
        named = {name: f"{name} [{unit}]" for name, unit in units.items()}
        text: str = table.rename(columns=named).reset_index().to_csv(index=False, lineterminator="\n")
        return text.encode()
    if isinstance(opened, TuningResults):
        return matlab_of_groups(opened.title, {"scores": opened._named_arrays()})
    return matlab_of_groups(opened.title, opened._named_groups())
