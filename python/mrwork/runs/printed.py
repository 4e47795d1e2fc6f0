"""A damper or a controller as C or FMU, in a folder of its own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np

from mrwork.base.keys import look_up
from mrwork.base.numbers import of_unit
from mrwork.closed_loop.printed_loop import printed_loop
from mrwork.closed_loop.user_law import UserLaw
from mrwork.control.laws.control_law import ControlLaw
from mrwork.control.laws.own_law import own_law_of_rows
from mrwork.embedded.c_source import USUAL_SAMPLE_TIME, CSource, Flavour, c_name
from mrwork.embedded.controller_c import controller_source
from mrwork.embedded.damper_c import damper_source
from mrwork.embedded.fmu import FMIVersion, c_compiler, fmu_of
from mrwork.errors import SettingError
from mrwork.identification.fit import Fit
from mrwork.records.read import ROTARY
from mrwork.runs.damper_text import refuse_bounds
from mrwork.runs.read_study import read_study
from mrwork.store.output_file import write_file
from mrwork.store.run_folder import check_output
from mrwork.study.trials import designed


def damper_of_fit(fit: Fit, name: str, flavour: Flavour, time_step: float | None) -> CSource:
    """The C of the damper of a fit; what the records add to its force is left out, and told in the head."""
    refuse_bounds(fit)
    of_tests = f"{fit.fit_in_words} of {len(fit.quality)} test{'s' if len(fit.quality) > 1 else ''}"
    rotary = [remark.as_sentence for remark in fit.remarks if remark.code == ROTARY.code]
    return damper_source(
        c_name(name),
        fit.spec,
        np.array(fit.theta),
        fit.tested,
        flavour,
        sample_time=USUAL_SAMPLE_TIME if time_step is None else time_step,
        origin=(
            f"Fit: {of_tests}, {fit.status_in_words}",
            *filter(None, [fit.observation_in_words, *rotary]),
        ),
    )


def controller_of_study(
    path: Path, name: str, flavour: Flavour, label: str | None, *, example: bool = False
) -> CSource:
    """The C of the controller of a law of a study file, which is designed as a run of the study designs it."""
    study = designed(read_study(path))
    printable = {
        arrangement.row.label: (_with_specification(arrangement.law), arrangement)
        for arrangement in study.arrangements
        if isinstance(arrangement.law, ControlLaw | UserLaw)
        and arrangement.row.kind in ("controller", "actuator")
    }
    if not printable:
        raise SettingError(
            f"{path} has no [[controller]] with a law of the package or of your own, and no other is printed as C"
        )
    if label is None and len(printable) > 1:
        raise SettingError(f"{path} has several laws: give --law NAME, one of {', '.join(printable)}")
    of_name = [own for own, (law, _) in printable.items() if label in (None, law.name)]
    if label not in printable and len(of_name) == 1:
        (label,) = of_name
    law, arrangement = look_up(
        label or "", printable, f"{path} has no law called {label!r} that is printed as C", otherwise="it has"
    )
    building, devices = arrangement.building, arrangement.devices
    storeys = [building.storey_names[storey] for storey in study.hardware.measured_storeys]
    return controller_source(
        c_name(name),
        printed_loop(building, devices, law, study.hardware, study.grounds),
        law,
        {"floor": building.floor_names, "storey": storeys, "device": [device.name for device in devices]},
        flavour,
        unit="N" if law.spec.commands_force else study.command_unit,
        origin=(f"Study: {study.title}; law: {label}", *law.notes),
        example=example,
    )


def _with_specification(law: ControlLaw | UserLaw) -> ControlLaw:
    return law if isinstance(law, ControlLaw) else own_law_of_rows(law.formula, law.source)


def files_of(source: CSource, to: Literal["c", "fmu"]) -> dict[str, bytes]:
    """Files of printed code by name: its texts, or an FMU for each version of the standard."""
    if to == "c":
        return {name: text.encode() for name, text in source.files.items()}
    compiler = c_compiler()
    versions: dict[str, FMIVersion] = {f"{source.name}.fmu": "2.0", f"{source.name}_fmi3.fmu": "3.0"}
    return {name: fmu_of(source, version, compiler) for name, version in versions.items()}


def write_files(folder: Path, files: Mapping[str, bytes], *, replace: bool) -> list[Path]:
    """Write files to a folder; none is written where one may not be."""
    paths = {folder / name: content for name, content in files.items()}
    for path in paths:
        check_output(path, replace=replace, otherwise="replace it by `--replace`, in Python `replace=True`")
    for path, content in paths.items():
        write_file(path, content)
    return list(paths)


def printed_in_words(source: CSource, to: Literal["c", "fmu"]) -> str:
    """What a user should know of printed code before he runs it."""
    steps = (
        f"{source.substeps} sub-step{'s' if source.substeps > 1 else ''} in "
        if source.kind == "damper"
        else ""
    )
    lines = [f"{source.description}: {steps}a sample of {of_unit(source.sample_time, 's')}", *source.notes]
    if to == "fmu" and c_compiler() is None:
        lines.append(
            "There is no C compiler here: the FMUs have sources and no binary, and the importer compiles them."
        )
    return "\n".join(lines)
