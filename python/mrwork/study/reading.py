"""Read a study file into a study that is ready to run; its errors have the line of the key."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.arguments import Seed, checked
from mrwork.buildings import Building
from mrwork.buildings.devices import Device
from mrwork.buildings.from_file import building_from_table
from mrwork.closed_loop.hardware import Fault, Hardware
from mrwork.errors import SettingError
from mrwork.keys import KeyPath, Place, suggestion
from mrwork.store.input_file import TOML, bytes_of, text_in, toml_table
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
    IdentifiedDamper,
    chosen_damper,
    equip_building,
    identified_damper,
)
from mrwork.study.declared import located, read_table
from mrwork.study.motions import motions_of_study
from mrwork.study.schema import DamperTable, HardwareTable, ReportTable, StudyTable
from mrwork.study.study import MotionOfStudy, Realisations, Study, StudyFile, posterior_draws, realisations_of
from mrwork.values import Floats

_BLANK = " \t\r\n"
_BARE_ENDS = frozenset("=.]}, \t\r\n#")
_VALUE_ENDS = frozenset(",]}\r\n#")


def parse(text: str, origin: str) -> tuple[dict[str, Any], dict[KeyPath, int]]:
    """A TOML document, and the line of every key, table and array element in it."""
    try:
        document = toml_table(text)
    except ValueError as reason:
        raise SettingError(f"{origin} is not TOML: {_with_small_first(str(reason))}") from None
    return document, _Scanner(text).lines()


def _with_small_first(text: str) -> str:
    return text[:1].lower() + text[1:]


class _Scanner:
    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0
        self._line = 1
        self._found: dict[KeyPath, int] = {}
        # Number of tables of each array of tables so far.
        self._counts: dict[KeyPath, int] = {}

    def lines(self) -> dict[KeyPath, int]:
        table: KeyPath = ()
        while self._skip_blank():
            line = self._line
            if self._text.startswith("[[", self._at):
                self._forward(2)
                *outer, last = self._key()
                path = (*self._resolve(tuple(outer)), last)
                self._forward(2)
                number = self._counts.get(path, 0)
                self._counts[path] = number + 1
                self._found.setdefault(path, line)
                table = (*path, number)
            elif self._text[self._at] == "[":
                self._forward(1)
                table = self._resolve(self._key())
                self._forward(1)
            else:
                self._pair(table)
                continue
            self._note(table, line)
        return self._found

    def _resolve(self, key: tuple[str, ...]) -> KeyPath:
        """The key of a header, with the index of the last table of each array of tables in it."""
        path: KeyPath = ()
        for part in key:
            path = (*path, part)
            if path in self._counts:
                path = (*path, self._counts[path] - 1)
        return path

    def _note(self, path: KeyPath, line: int) -> None:
        for length in range(1, len(path) + 1):
            self._found.setdefault(path[:length], line)

    def _pair(self, table: KeyPath) -> None:
        line = self._line
        path = (*table, *self._key())
        self._note(path, line)
        self._forward(1)
        self._skip_spaces()
        self._value(path)

    def _value(self, path: KeyPath) -> None:
        opening = self._text[self._at]
        if opening == "[":
            self._forward(1)
            number = 0
            while self._skip_blank() and self._text[self._at] != "]":
                self._found[*path, number] = self._line
                self._value((*path, number))
                number += 1
                self._skip_comma()
            self._forward(1)
        elif opening == "{":
            self._forward(1)
            while self._skip_blank() and self._text[self._at] != "}":
                self._pair(path)
                self._skip_comma()
            self._forward(1)
        elif opening in "\"'":
            self._string()
        else:
            while self._at < len(self._text) and self._text[self._at] not in _VALUE_ENDS:
                self._forward(1)

    def _key(self) -> tuple[str, ...]:
        """A dotted key, up to the character that ends it."""
        parts: list[str] = []
        while True:
            self._skip_spaces()
            start = self._at
            if self._text[start] in "\"'":
                self._string()
                # The parser resolves escapes.
                parts.append(toml_table(f"k = {self._text[start : self._at]}")["k"])
            else:
                while self._text[self._at] not in _BARE_ENDS:
                    self._forward(1)
                parts.append(self._text[start : self._at])
            self._skip_spaces()
            if self._text[self._at] != ".":
                return tuple(parts)
            self._forward(1)

    def _string(self) -> None:
        quote = self._text[self._at]
        if self._text.startswith(quote * 3, self._at):
            end = self._at + 3
            while not self._text.startswith(quote * 3, end):
                end += 2 if quote == '"' and self._text[end] == "\\" else 1
            end += 3
            # Up to two more quotes belong to the string.
            while self._text.startswith(quote, end):
                end += 1
        else:
            end = self._at + 1
            while self._text[end] != quote:
                end += 2 if quote == '"' and self._text[end] == "\\" else 1
            end += 1
        self._forward(end - self._at)

    def _skip_comma(self) -> None:
        if self._skip_blank() and self._text[self._at] == ",":
            self._forward(1)

    def _skip_blank(self) -> bool:
        """Skip blanks and comments; whether a character follows."""
        while self._at < len(self._text):
            if self._text[self._at] == "#":
                end = self._text.find("\n", self._at)
                self._at = len(self._text) if end < 0 else end
            elif self._text[self._at] in _BLANK:
                self._forward(1)
            else:
                return True
        return False

    def _skip_spaces(self) -> None:
        while self._text[self._at] in " \t":
            self._forward(1)

    def _forward(self, count: int) -> None:
        self._line += self._text.count("\n", self._at, self._at + count)
        self._at += count


@checked
def read_study(
    path: str | Path,
    identified: Identified = identified_damper,
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
    with located(place.within("building")):
        bare = building_from_table(table.building, place.within("building"), folder=folder)
    building, devices, chosen = equip_building(bare, table.damper, folder, identified)
    hardware = _make_hardware(table.hardware, place.within("hardware"), seed)
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
    detailed, drawn = _choose_drawn(table.report, motions, labels, place)
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
            *_facts(bare, devices, chosen, table.hardware),
            *(
                (f"Weights of {each.row.label}", " ".join(each.law.notes))
                for each in compared
                if each.law is not None and each.law.notes
            ),
        ),
        detailed=detailed,
        drawn=drawn,
        histories={"detailed": (detailed,), "all": tuple(range(len(motions))), "none": ()}[
            table.report.histories
        ],
        problem=problem,
        tunes=tuple(resolve_settings(each, folder) for each in table.tune),
        realisations=_realisations(table, place, devices, folder, identified),
        clairvoyant=clairvoyant,
    )


def _realisations(
    table: StudyTable, place: Place, devices: Sequence[Device], folder: Path, identified: Identified
) -> Realisations | None:
    """The realisations of [uncertainty], if the study has that table."""
    given = table.uncertainty
    if given is None:
        return None
    where = place.within("uncertainty")
    drawn: list[Floats | None] = []
    for each in table.damper:
        rows = posterior_draws(each, folder) if given.damper else None
        if rows is not None:
            # One draw for each realisation, equally spread over the chains.
            places = np.linspace(0, len(rows) - 1, given.realisations).round().astype(np.int64)
            fit = identified(folder / str(each.run))
            rows = np.stack([_with_parameters(each, fit, row, folder) for row in rows[places]])
        drawn.append(rows)
    if not any((given.stiffness, given.damping, given.delay, *(rows is not None for rows in drawn))):
        where.refuse(
            "nothing in [uncertainty] is uncertain; give it a stiffness, a damping or a delay, or a [[damper]] with a "
            "run that has posterior draws"
        )
    with located(where):
        return realisations_of(given, devices, drawn)


def _with_parameters(table: DamperTable, fit: IdentifiedDamper, theta: Floats, folder: Path) -> Floats:
    """Parameters of the damper of a table whose fit has the parameters `theta`."""
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


def _choose_drawn(
    table: ReportTable, motions: Sequence[MotionOfStudy], labels: Sequence[str], place: Place
) -> tuple[int, tuple[int, ...]]:
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
    detailed = largest if table.motion is None else names.index(table.motion)
    drawn = [
        number for number, label in enumerate(labels) if not table.controllers or label in table.controllers
    ]
    return detailed, tuple(drawn)


def _facts(
    bare: Building, devices: Sequence[Device], chosen: Sequence[ChosenDamper], hardware: HardwareTable
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


def _make_hardware(table: HardwareTable, place: Place, seed: int) -> Hardware:
    """The hardware of a table; `seed` is that of the sensor noise."""
    converted = ("fault", "measured_floors")
    plain = {entry.name: getattr(table, entry.name) for entry in fields(table) if entry.name not in converted}
    faults = []
    for fault in table.fault:
        if fault.end <= fault.start:
            fault.place.refuse(
                f"the fault lasts from {fault.start:g} to {fault.end:g} s; give an end after its start"
            )
        faults.append(
            Fault(
                channel=fault.signal,
                index=fault.number - 1,
                start=fault.start,
                end=fault.end,
                value="hold" if fault.value is None else fault.value,
            )
        )
    with located(place):
        floors = (
            None if table.measured_floors is None else tuple(floor - 1 for floor in table.measured_floors)
        )
        return Hardware(**plain, measured_floors=floors, seed=seed, faults=tuple(faults))
