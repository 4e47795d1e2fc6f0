"""Read a study file into a study that is ready to run; its errors have the line of the key."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.arguments import Seed, checked
from mrwork.buildings import Building
from mrwork.buildings.matrices import Device
from mrwork.closed_loop.hardware import Hardware
from mrwork.errors import SettingError
from mrwork.fitted_damper import fitted_damper
from mrwork.keys import KeyPath, Place, read_table, suggestion
from mrwork.store.input_file import TOML, bytes_of, text_in
from mrwork.store.parse import toml_lines, toml_table
from mrwork.study.arrangements import (
    arrangements,
    clairvoyant_row,
    problem_of,
    resolve_settings,
    running_in_words,
)
from mrwork.study.dampers import (
    ChosenDamper,
    Identified,
    chosen_damper,
    equip_building,
)
from mrwork.study.motions import motions_of_study
from mrwork.study.schema import DamperTable, ReportTable, StudyTable
from mrwork.study.study import MotionOfStudy, Realisations, Study, StudyFile, realisations_of
from mrwork.tested_range import FittedDamper
from mrwork.values import Floats


def parse(text: str, origin: str) -> tuple[dict[str, Any], dict[KeyPath, int]]:
    """A TOML document, and the line of every key, table and array element in it."""
    try:
        document = toml_table(text)
    except ValueError as reason:
        raise SettingError(f"{origin} is not TOML: {_with_small_first(str(reason))}") from None
    return document, toml_lines(text)


def _with_small_first(text: str) -> str:
    return text[:1].lower() + text[1:]


@checked
def read_study(
    path: str | Path,
    identified: Identified = fitted_damper,
    *,
    seed: Seed = 0,
    on_python: Callable[[str], None] = lambda sentence: None,
) -> Study:
    """Read a study.

    Parameters
    ----------
    path
        The TOML file; names of other files in it are relative to its folder.
    identified
        Reads model and parameters from the folder of an identified damper.
    seed
        Seed of noise and synthetic motions.
    on_python
        Called with a sentence that names the file of each law in Python, before any of these files runs.

    Raises
    ------
    RecordError
        If the file does not exist or is not text.
    SettingError
        If anything in it is wrong; the message has file and line.
    """
    path = Path(path)
    file = _read(path)
    table, place = _tables(file, str(path))
    folder = path.parent / table.folder
    for each in table.controller:
        if each.user is not None:
            on_python(running_in_words(each.user, folder))
    with place.within("building").prefix_errors(SettingError):
        bare = table.building.build(folder)
    building, devices, chosen = equip_building(bare, table.damper, folder, identified)
    with place.within("hardware").prefix_errors(SettingError):
        hardware = replace(table.hardware, seed=seed)
    motions = motions_of_study(table.motion, folder, seed, sample_time=hardware.sample_time)
    if not motions:
        place.refuse("the study has no motion; give a [[motion]]")
    training = tuple(motion.ground for motion in motions if motion.use == "training")
    if len(training) == len(motions):
        place.within("motion").refuse(
            'every motion is for training, and none is left to judge the controllers on; give a [[motion]] use = "test"'
        )
    _refuse_same([motion.name for motion in motions], place.within("motion"), "motions", "name")
    problem = problem_of(table, building, devices, hardware)
    compared = arrangements(table, bare, problem, folder)
    clairvoyant = (
        None if table.clairvoyant is None else clairvoyant_row(table.clairvoyant, devices, hardware, seed)
    )
    labels = [each.row.label for each in compared] + ([clairvoyant.row.label] if clairvoyant else [])
    _refuse_same(labels, place.within("controller"), "arrangements", "label")
    first = chosen[0].spec.current if chosen else None
    detailed = _choose_detailed(table.report, motions, labels, place)
    return Study(
        title=table.title or bare.name,
        file=file,
        building=bare,
        arrangements=compared,
        motions=motions,
        chosen_on=training or tuple(motion.ground for motion in motions),
        hardware=hardware,
        devices=devices,
        command_unit="A" if first is None else first.unit,
        facts=(
            *_facts(bare, devices, chosen, hardware),
            *(
                (f"Weights of {each.row.label}", " ".join(each.law.notes))
                for each in compared
                if each.law is not None and each.law.notes
            ),
        ),
        detailed=detailed,
        histories={"detailed": (detailed,), "all": tuple(range(len(motions))), "none": ()}[
            table.report.histories
        ],
        report=table.report,
        problem=problem,
        tunes=tuple(resolve_settings(each, folder) for each in table.tune),
        realisations=_realisations(table, place, devices, folder, identified),
        clairvoyant=clairvoyant,
    )


def _realisations(
    table: StudyTable, place: Place, devices: Sequence[Device], folder: Path, identified: Identified
) -> Realisations | None:
    given = table.uncertainty
    if given is None:
        return None
    where = place.within("uncertainty")
    drawn: list[Floats | None] = []
    for each in table.damper:
        rows = None
        if given.damper and each.run is not None:
            fit = identified(folder / each.run)
            rows = fit.draws()
            if rows is None:
                each.place.within("run").refuse(
                    f"{each.run} has no posterior draws, and [uncertainty] asks for them; run mrwork sample {each.run} "
                    "first, or set damper = false there"
                )
            # One draw for each realisation, equally spread over the chains.
            places = np.linspace(0, len(rows) - 1, given.realisations).round().astype(np.int64)
            rows = np.stack([_with_parameters(each, fit, row, folder) for row in rows[places]])
        drawn.append(rows)
    if not any((given.stiffness, given.damping, given.delay, *(rows is not None for rows in drawn))):
        where.refuse(
            "nothing in [uncertainty] is uncertain; give it a stiffness, a damping or a delay, or a [[damper]] with a "
            "run that has posterior draws"
        )
    with where.prefix_errors(SettingError):
        return realisations_of(given, devices, drawn)


def _with_parameters(table: DamperTable, fit: FittedDamper, theta: Floats, folder: Path) -> Floats:
    drawn = replace(fit, theta=tuple(theta.tolist()))
    return chosen_damper(table, folder, lambda run: drawn).theta


def _read(path: Path) -> StudyFile:
    content = bytes_of(path, TOML)
    # Refused here, by the name that was given.
    text_in(content, path, TOML)
    return StudyFile(path=path.resolve(), content=content)


def _tables(file: StudyFile, origin: str) -> tuple[StudyTable, Place]:
    document, lines = parse(file.text, origin)
    place = Place(origin=origin, lines=lines)
    return read_table(StudyTable, document, place), place


def _refuse_same(names: Sequence[str], place: Place, what: str, key: str) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            place.refuse(f"two {what} are called {name!r}; give one of them another {key}")
        seen.add(name)


def _choose_detailed(
    table: ReportTable, motions: Sequence[MotionOfStudy], labels: Sequence[str], place: Place
) -> int:
    """Index of the motion of the time histories; what [report] names must be in the study."""
    names = [motion.name for motion in motions]
    where = place.within("report")
    if table.motion is not None and table.motion not in names:
        near = suggestion(table.motion, names)
        where.within("motion").refuse(f"no motion is called {table.motion!r}{near}")
    for label in table.controllers:
        if label not in labels:
            near = suggestion(label, labels)
            where.within("controllers").refuse(f"no arrangement is called {label!r}{near}")
    largest = int(np.argmax([motion.ground.peak * (motion.use == "test") for motion in motions]))
    return largest if table.motion is None else names.index(table.motion)


def _facts(
    bare: Building, devices: Sequence[Device], chosen: Sequence[ChosenDamper], hardware: Hardware
) -> tuple[tuple[str, str], ...]:
    frequencies = ", ".join(f"{frequency:.3g}" for frequency in bare.frequencies[:5])
    source = f"; {bare.source} ({bare.status})" if bare.source else ""
    facts = [("Building", f"{bare.name}, {frequencies} Hz{source}")]
    for device, damper in zip(devices, chosen, strict=True):
        count = f"{device.count} x " if device.count > 1 else ""
        pair = ", a differential pair" if device.differential else ""
        fixed = "" if damper.spec.follows_command else ", passive: all its parameters are constant"
        facts.append((device.name[:1].upper() + device.name[1:], f"{count}{device.spec.title}{pair}{fixed}"))
    facts += [("Parameters", text) for text in dict.fromkeys(damper.source for damper in chosen)]
    tested = [damper.tested.in_words if damper.tested else "not known" for damper in chosen]
    facts += [("Tested ranges", text) for text in dict.fromkeys(tested)]
    facts.append(
        (
            "Loop",
            f"a command every {1e3 * hardware.sample_time:g} ms, delay {1e3 * hardware.delay:g} ms, steps of "
            f"{1e3 * hardware.step:g} ms, feedback of the {hardware.feedback}",
        )
    )
    return tuple(facts)
