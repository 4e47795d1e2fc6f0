"""A study ready to run: buildings with devices and laws, motions, hardware; and the fingerprint of its inputs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any, ClassVar, Final, get_args

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.arguments import NotNegative, checked
from mrwork.base.keys import Key, keys_of
from mrwork.base.places import Place, keyed
from mrwork.base.remark import Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary, list_names, named
from mrwork.base.table import Table
from mrwork.buildings import Building
from mrwork.buildings.building_remarks import coordinate_remarks
from mrwork.buildings.device import Device
from mrwork.buildings.groups import commanded, joined_units, sends_forces
from mrwork.closed_loop.evaluation import SCORE
from mrwork.closed_loop.hardware import Hardware, refuse_unread
from mrwork.closed_loop.laws_of_users import remark_on_python
from mrwork.closed_loop.loop_sample import READINGS
from mrwork.closed_loop.observer import estimates_absolute
from mrwork.closed_loop.process_law import ProcessLaw
from mrwork.closed_loop.user_law import UserLaw
from mrwork.control.laws.control_law import ControlLaw, control_law
from mrwork.control.laws.counterpart import is_curve
from mrwork.control.laws.law_problem import DesignProblem
from mrwork.control.laws.law_settings import SETTINGS, design_law, settings_of
from mrwork.control.weights.weight_certificate import DesignedWeights
from mrwork.errors import InvalidSettingError, SettingError
from mrwork.motions import GroundMotion
from mrwork.motions.ground_motion import copies_remarks, peak_push
from mrwork.motions.spectrum import Intensity
from mrwork.motions.targets import SuiteCheck
from mrwork.store.codec import digest_of, package_version
from mrwork.study.dampers import Identified, OtherSet
from mrwork.study.realisations import Realisations
from mrwork.study.row_kinds import ROW_KINDS, Kind, RowKind
from mrwork.study.schema import ControllerTable, StudyTable, TuneTable, Use
from mrwork.study.study_file import write_study_file

WEIGHT = "control_weight"
"""R of a regulator."""


StudyLaw = ControlLaw | UserLaw | ProcessLaw
"""A law of the registry, or one of the user, in Python or outside of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionFacts:
    """A motion in tables: peak [m/s^2], duration [s], source, processing, use, groups, record, intensity, force [N].

    The intensity is in the measure that the motion was scaled to, else its peak. `level` is what it was scaled to in
    words, as "0.3 g" or "factor 2"; `copy_of` names the record that its own is a copy of. The ground may be a road.
    """

    name: str
    peak: NotNegative
    duration: NotNegative
    source: str = ""
    changes: tuple[str, ...] = ()
    synthetic: bool = False
    use: Use = "test"
    groups: tuple[str, ...] = ()
    record: str
    intensity: Intensity
    level: str = ""
    copy_of: str = ""
    peak_force: NotNegative = 0.0
    is_road: bool = False


@checked
class MotionOfStudy:
    """A ground motion of a study as it is simulated, its facts, the `factor` that scaled it, and remarks on its record.

    A record that is scaled to several intensities is a motion at each.
    """

    ground: GroundMotion
    facts: MotionFacts
    factor: float | None = None
    remarks: tuple[Remark, ...] = ()

    @property
    def level(self) -> float:
        """Its factor, if it was scaled by one, else its intensity [m/s^2]."""
        return self.facts.intensity.value if self.factor is None else self.factor


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """An arrangement in tables: its label, its kind, and a description."""

    label: str
    kind: Kind
    description: str = ""

    @property
    def what(self) -> RowKind:
        """What rows of its kind are."""
        return ROW_KINDS[self.kind]


@dataclass(frozen=True, slots=True, kw_only=True)
class TakenSettings:
    """Settings that a law lacked in the study file: values by name, how they came, and the line for another choice.

    `runs` counts the runs of the scan.
    """

    settings: Mapping[str, Any]
    origin: tuple[str, ...]
    remedy: str
    runs: int = 0

    @property
    def in_words(self) -> tuple[str, ...]:
        """How they came, and what to type for another choice."""
        remedy = [f"For others give the law `{self.remedy}`"] if self.remedy else []
        return f"Not given, and taken: {'; '.join(self.origin)}.", *remedy


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedLaw:
    """A law of the registry by its name, with the settings that its table gives in SI, and what it is designed for.

    `number` counts its table in the study.
    """

    table: ControllerTable
    number: int
    given: Mapping[str, Any]
    problem: DesignProblem

    @property
    def missing(self) -> list[Key]:
        """Settings that the law needs, and that are not given."""
        kind = SETTINGS[self.table.law]
        missing = [entry for entry in keys_of(kind) if entry.is_required and entry.name not in self.given]
        if kind.is_regulator and not {WEIGHT, "gain"} & self.given.keys():
            missing += [entry for entry in keys_of(kind) if entry.name == WEIGHT]
        return missing

    @property
    def lacks_motion(self) -> bool:
        """Whether the static model of its damper wants the expected motion of that, which is not given."""
        is_unknown = None in (self.problem.amplitude, self.problem.velocity)
        is_needed = control_law(self.table.law).needs_curve and not is_curve(self.problem.devices[0].spec)
        return is_unknown and is_needed

    @property
    def is_complete(self) -> bool:
        """Whether it can be designed as it is given."""
        return not self.missing and not self.lacks_motion

    def shaped(self, law: ControlLaw) -> ControlLaw:
        """A law with dead zone, slope, largest force and state of the table."""
        forces = law.spec.commands_force
        limit = self.table.command_in("largest_command", "N") if forces else None
        return replace(
            law,
            dead_zone=self.table.dead_zone,
            command_slope=self.table.slope_in("N" if forces else self.problem.devices[0].command_unit or "A"),
            largest_force=math.inf if limit is None else limit,
            state=self.table.state,
        )

    def design(self, problem: DesignProblem, taken: Mapping[str, Any]) -> ControlLaw:
        """The gains of the law, with settings that were taken where none were given."""
        with keyed(*(["settings"] if self.table.settings is not None else [])):
            settings = settings_of(self.table.law, {**self.given, **taken})
            return self.shaped(design_law(self.table.law, problem, settings))


@dataclass(frozen=True, kw_only=True)
class Arrangement:
    """A building with devices under one law; without a law, it gets the best constant command.

    A law that is `named` is still to be designed, see `mr.study.designed`.
    `taken` are settings that the study file leaves out; `added` says that it has no such row, so that a journal of the
    same file without it can be continued. `bare` is the building without dampers, to which an arrangement may add
    a base slab or a storey of isolators.
    """

    row: Row
    bare: Building
    building: Building
    devices: tuple[Device, ...]
    law: StudyLaw | None
    named: NamedLaw | None = None
    taken: TakenSettings | None = None
    added: bool = False

    def __post_init__(self) -> None:
        if self.law is not None and self.devices:
            driven = commanded(self.devices)
            law = self.law if isinstance(self.law, ControlLaw) else self.law.placeholder(driven)
            law.gain_rows(len(driven), 2 * self.building.n_coordinates)

    @cached_property
    def places(self) -> Mapping[str, list[int]]:
        """Indices of every floor and storey of the bare building, without isolators and their slab."""
        return {
            "floor": [*map(self.building.floor_names.index, self.bare.frame_floors)],
            "storey": [*map(self.building.storey_names.index, self.bare.drift_names)],
        }

    @property
    def strokes(self) -> list[int]:
        """Indices of isolators and additions, which have a stroke; one behind a brace is that of its damper."""
        names, added = self.building.storey_names, set(range(len(self.building.storeys)))
        added -= {*self.places["storey"]}
        return [
            index for index in sorted(added) if not self.devices or names[index] in self.bare.storey_names
        ]

    @property
    def passive_devices(self) -> list[int]:
        """Places of the passive elements that are devices: storeys that yield are parts of the frame."""
        return [index for index, element in enumerate(self.building.elements) if not element.in_stiffness]


def commands_force(arrangement: Arrangement) -> bool:
    """Whether the law of an arrangement commands forces, which ideal actuators exert."""
    law = arrangement.law
    return sends_forces(arrangement.devices) or (isinstance(law, ControlLaw) and law.spec.commands_force)


def replaces_dampers(arrangement: Arrangement) -> bool:
    """Whether the law of an arrangement commands forces in the place of dampers that follow a command."""
    return commands_force(arrangement) and not sends_forces(arrangement.devices)


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyFile:
    """The file of a study as it was read: its absolute path, and its content."""

    path: Path
    content: bytes

    @property
    def text(self) -> str:
        """The content as text, each line ended by a newline alone."""
        return self.content.decode("utf-8-sig").replace("\r\n", "\n")


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyOrigin:
    """Where a study is from: names of files in its table are relative to `folder`, and `identified` reads run folders.

    `file` is the file that was read, if it was one; `place` adds its lines to what is refused later.
    """

    folder: Path
    identified: Identified
    file: StudyFile | None
    place: Place


_OBSERVED: Final = RemarkKind(
    "forces_observed",
    "the observer takes the forces of motion {0} for accelerations of the ground, and estimates another motion",
    "let it integrate measured accelerations, by kinematic = true of the hardware",
)
_FORECAST: Final = RemarkKind(
    "forces_not_forecast",
    "{0} predicts the motion without the forces of motion {1}",
    "let measured accelerations stand for them, by shear_offsets = true of the law",
)
_WORST_PLACE: Final = RemarkKind(
    "score_of_worst_place",
    "{0} is a road, and the score, by which the best constant command is chosen, is of the worst place, mostly a wheel",
    'state what counts in [report], as score = ["rms_acceleration@{1}", "rms_drift@{2}"]',
)
_UNSPRUNG: Final = RemarkKind(
    "sprung_missing",
    "{0} reads the motion of the upper end of {1} less that of its lower end, which on a road is mostly that of the "
    "damper itself",
    'name the floor whose absolute motion it reads, as sprung = "{2}" of [[damper]]',
)
_ROAD_OBSERVED: Final = RemarkKind(
    "road_observed",
    "the observer takes {0} for an earthquake, and estimates no absolute velocities, which {1} reads",
    "leave kinematic and known_ground of the hardware out, and keep roads and other motions in studies of their own",
)
_SAME_BUILDING: Final = RemarkKind(
    "baseline_same",
    "{0} is the building itself",
    "give the baseline what changes the building, or leave it out",
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Study(Summarised):
    """A study, of a file or of a call.

    The first arrangements are the building without dampers and the dampers at i = 0. Laws that lack settings are only
    named in theirs, see `mr.study.designed`.

    `motions` are simulated; under `chosen_on` the best constant command is chosen: the training motions of the study
    file, or all motions where none is for training, of these the ones of the `design_levels`, which are named where
    there is one level, or records have several. `histories` are the indices of the motions whose histories are kept.
    The page shows time histories of the motion `detailed`, and `limit` is the criterion with its limit of which it has
    the fragility. `problem` is the building with its dampers for which laws are designed, `tunes` the laws to be tuned,
    `realisations` of what is not known exactly. `other_sets` are the dampers with other sets of laws that predict
    nearly as well. `suite` has the spectra of the test motions beside the target, if there is one and each record has
    one level. `described` are headings and sentences on building, dampers and loop, `unusual` are remarks on numbers of
    the table. Criteria `asked` for are those on request, as at a place. `table` is what the study was stated by, and it
    `is_whole` where it has all motions and rows of that.
    """

    _made_by: ClassVar[str] = "mr.study_of(building=..., motions=...) or mr.read_study(path)"

    table: StudyTable
    origin: StudyOrigin = field(repr=False, compare=False)
    building: Building
    arrangements: tuple[Arrangement, ...]
    motions: tuple[MotionOfStudy, ...]
    chosen_on: tuple[GroundMotion, ...]
    design_levels: tuple[str, ...]
    limit: Mapping[str, float]
    hardware: Hardware
    described: tuple[tuple[str, str], ...]
    detailed: int
    histories: tuple[int, ...]
    problem: DesignProblem
    tunes: tuple[TuneTable, ...] = ()
    realisations: Realisations | None = None
    other_sets: tuple[OtherSet, ...] = ()
    suite: SuiteCheck | None = None
    unusual: tuple[Remark, ...] = ()
    asked: tuple[str, ...] = ()
    is_whole: bool = True

    @property
    def title(self) -> str:
        """Heading of the page: the title that the study states, else the name of its building."""
        return self.table.title or self.building.name

    @property
    def scored(self) -> tuple[str, ...]:
        """Names of the criteria of the score."""
        return self.table.report.score

    @property
    def command_unit(self) -> str:
        """Unit of the commands, A without dampers, "A and V" where some follow a current and others a voltage."""
        return joined_units(device.command_unit for device in commanded(self.devices)) or "A"

    @property
    def facts(self) -> tuple[tuple[str, str], ...]:
        """Headings and sentences on the parts of the study and the designs of its laws."""
        return (*self.described, *((heading, " ".join(notes)) for heading, notes in self.design_notes))

    @property
    def rows(self) -> tuple[Row, ...]:
        """The rows of tables: every arrangement."""
        return tuple(arrangement.row for arrangement in self.arrangements)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """On records and their target, on the building and its baselines, on unusual numbers, and on loops of laws.

        Damping of a baseline is told of only where there is nothing to be said of the building, and its coordinates
        where those of the building are not asked about.
        """
        bare = digest_of_run(self.arrangements[0])
        baselines = [arrangement for arrangement in self.arrangements if arrangement.row.kind == "baseline"]
        of_each = (self.building.remarks, *(baseline.building.damping_remarks for baseline in baselines))
        own, *others = (
            [*each.building.ordering, *coordinate_remarks(each.building)]
            for each in (self.arrangements[0], *baselines)
        )
        asked = [] if own else [remark for each in others for remark in each]
        same = (
            _SAME_BUILDING.remark(baseline.row.label)
            for baseline in baselines
            if digest_of_run(baseline) == bare
        )
        copies: dict[str, list[str]] = {}
        for copy, first in product(self.motions, repeat=2):
            # A record that is named twice for its levels is no copy.
            is_level = first.ground.source == copy.ground.source and first.level != copy.level
            if first.facts.record == copy.facts.copy_of != copy.facts.record and not is_level:
                copies.setdefault(copy.facts.copy_of, []).append(copy.facts.record)
        of_records = dict.fromkeys(remark for motion in self.motions for remark in motion.remarks)
        of_motions = (*of_records, *copies_remarks(copies))
        of_motions += () if self.suite is None else self.suite.far_from_target
        of_laws = (
            replace(remark, message=f"{label}: {remark.message}", words=(label, *remark.words))
            for label, law in self.laws
            for remark in law.remarks
        )
        of_loops = (*self._remarks_of_forces(), *self._remarks_of_roads(), *self._remarks_of_users())
        of_all = (*self.unusual, *of_loops, *of_laws)
        return (*of_motions, *next(filter(None, of_each), ()), *asked, *same, *of_all)

    def _remarks_of_forces(self) -> Iterator[Remark]:
        """What forces on floors do to observers and forecasts, which know the ground alone."""
        forced = next((ground.name for ground in self.grounds if ground.forces.size), None)
        if forced is None:
            return
        if self.hardware.feedback != "state" and not self.hardware.kinematic:
            yield _OBSERVED.remark(forced)
        for label, law in self.laws:
            if law.spec.needs_model and not np.ravel(law.tables["shears"])[0] > 0.0:
                yield _FORECAST.remark(label, forced)

    def _remarks_of_users(self) -> Iterator[Remark]:
        for arrangement in self.arrangements:
            law, driven = arrangement.law, commanded(arrangement.devices)
            if law is not None and driven:
                remark = remark_on_python(law, arrangement.building, driven, self.hardware)
                if remark is not None:
                    yield remark

    def _remarks_of_roads(self) -> Iterator[Remark]:
        road = next((ground.name for ground in self.grounds if ground.is_road), None)
        floors = self.building.frame_floors
        if road is not None and len(floors) > 1 and self.devices and self.scored == SCORE:
            yield _WORST_PLACE.remark(road, floors[-1], self.building.drift_names[0])
        unsprung = next((device.name for device in commanded(self.devices) if device.sprung is None), None)
        for label, law in self.laws:
            if road is not None and unsprung is not None and law.spec.reads_sprung:
                yield _UNSPRUNG.remark(label, unsprung, floors[-1])
        is_observed = self.hardware.feedback != "state"
        for label, law in self.laws if is_observed else ():
            reads = law.spec.reads_sprung or (law.spec.reads_state and law.state != "relative")
            if road is not None and reads and not estimates_absolute(law, self.grounds, self.hardware):
                yield _ROAD_OBSERVED.remark(road, label)
                return

    @property
    def at_zero(self) -> Arrangement:
        """The arrangement of the dampers at i = 0, which only a study with dampers has."""
        return next(arrangement for arrangement in self.arrangements if arrangement.row.kind == "passive_off")

    @property
    def devices(self) -> tuple[Device, ...]:
        """The dampers at one place each, those that a law commands first."""
        return self.problem.all_devices

    @property
    def device_names(self) -> tuple[str, ...]:
        """Names of the dampers at one place each."""
        return tuple(device.name for device in self.devices)

    @property
    def grounds(self) -> tuple[GroundMotion, ...]:
        """The ground motions that are simulated, in order."""
        return tuple(motion.ground for motion in self.motions)

    def check_readings(self) -> None:
        """Refuse settings of the hardware that no law reads."""
        every = [arrangement.law for arrangement in self.arrangements]
        sent = {reading for law in every if isinstance(law, UserLaw | ProcessLaw) for reading in law.readings}
        laws = [law for _, law in self.laws]
        tuned = [control_law(name) for tune in self.tunes for name in tune.laws]
        if any(spec.own is not None for spec in (*(law.spec for law in laws), *tuned)):
            # What a law of the user reads is known when it is recorded.
            sent |= {*READINGS}
        needs_model = any(spec.needs_model for spec in tuned)
        reads_sprung = any(spec.reads_sprung for spec in (*(law.spec for law in laws), *tuned))
        for number, damper in enumerate(self.table.damper):
            if damper.sprung is not None and not reads_sprung:
                raise InvalidSettingError(
                    ("damper", number, "sprung"),
                    "sprung has no effect on laws that do not read the absolute motion of a floor; leave it out, or "
                    "add a [[controller]] with one that does, as mixed_skyhook",
                )
        reads = [*(law.reads_acceleration for law in laws), *(spec.reads_acceleration for spec in tuned)]
        forecasts = needs_model or any(law.forecasts_ground for law in laws)
        with keyed("hardware"):
            refuse_unread(
                self.hardware,
                accelerations="acceleration" in sent or needs_model or any(reads),
                drifts="drift" in sent,
                forecasts=forecasts,
            )

    @checked
    def of_use(self, use: Use) -> Study:
        """The study with the motions of one use; the best constant command is chosen on the same motions as before.

        Raises
        ------
        SettingError
            If no motion has this use.

        Examples
        --------
        >>> import mrwork as mr
        >>> study = mr.read_study("study.toml")  # doctest: +SKIP
        >>> study.of_use("training").grounds  # doctest: +SKIP
        """
        numbers = [number for number, motion in enumerate(self.motions) if motion.facts.use == use]
        if not numbers:
            raise SettingError(
                f"study {self.title!r}: no motion is for {use}; give one of its motions use = {use!r}"
            )
        peaks = [peak_push(self.grounds[number], self.building.reference_mass) for number in numbers]
        detailed = self.detailed if self.detailed in numbers else numbers[int(np.argmax(peaks))]
        stored = {detailed if number == self.detailed else number for number in self.histories}
        return replace(
            self,
            is_whole=self.is_whole and len(numbers) == len(self.motions),
            motions=tuple(self.motions[number] for number in numbers),
            detailed=numbers.index(detailed),
            histories=tuple(numbers.index(number) for number in sorted(stored) if number in numbers),
        )

    @checked
    def to_toml(self, path: str | Path, *, replace: bool = False) -> Path:
        """Write the study file that gives the same results, for `mrwork respond` and `mr.read_study`.

        Buildings, motions, fits and functions that were given as values are written into the folder ``NAME_files``
        beside the file ``NAME.toml``: matrices and samples as text with every digit, a fit as a run folder, a function
        as a Python file with what it uses. Other files keep their places, and the study file names the folder that
        their names are relative to. What a study of another seed than 0 draws it draws again where it is read with
        that seed, which the first line tells.

        Parameters
        ----------
        path
            The file.
        replace
            Whether files of these names are replaced.

        Raises
        ------
        SettingError
            If the study was made from another, by `of_use` or `mr.tuning.with_tuned_law`, or a function has no text.
        OutputError
            If the file or the folder is there already, or cannot be written.

        Examples
        --------
        >>> import mrwork as mr
        >>> study = mr.study_of(building=mr.building("uts"), motions=[mr.synthetic_motion(rng=0, duration=5.0)])
        >>> study.to_toml("study.toml")  # doctest: +SKIP
        """
        if not self.is_whole:
            raise SettingError(
                f"study {self.title!r} has not the motions or laws of its file; write the study that it was made from"
            )
        write_study_file(self.table, self.origin.folder, self.hardware.seed, Path(path), replace=replace)
        return Path(path)

    @property
    def designs(self) -> tuple[tuple[tuple[str, ...], DesignedWeights], ...]:
        """Designed weights, each with the labels of the rows that have them."""
        by_design: dict[int, tuple[list[str], DesignedWeights]] = {}
        for label, law in self.laws:
            if law.weights is not None:
                by_design.setdefault(id(law.weights), ([], law.weights))[0].append(label)
        return tuple((tuple(labels), weights) for labels, weights in by_design.values())

    @property
    def design_notes(self) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """Headings and sentences: of motions and target, of settings taken, of each design, of each law on its gain."""
        taken = ((f"Settings of {label}", settings.in_words) for label, settings in self.taken_settings)
        designs = ((f"Weights of {', '.join(labels)}", weights.in_words) for labels, weights in self.designs)
        loops = ((f"Loop of {label}", (*law.notes, *law.shaping_notes)) for label, law in self.laws)
        suites = [] if self.suite is None else [self.suite]
        motions = ((f"Motions beside {suite.target.name}", suite.in_words) for suite in suites)
        return (*motions, *taken, *designs, *((heading, notes) for heading, notes in loops if notes))

    @property
    def taken_settings(self) -> tuple[tuple[str, TakenSettings], ...]:
        """Settings that the study file leaves out, by the label of their row."""
        return tuple(
            (arrangement.row.label, arrangement.taken)
            for arrangement in self.arrangements
            if arrangement.taken is not None
        )

    @property
    def laws(self) -> tuple[tuple[str, ControlLaw], ...]:
        """Laws of the registry, each with the label of its row."""
        return tuple(
            (arrangement.row.label, arrangement.law)
            for arrangement in self.arrangements
            if isinstance(arrangement.law, ControlLaw)
        )

    def _summary(self) -> Summary:
        rows = [(row.label, row.description) for row in self.rows]
        return Summary(
            title=f"Study: {self.title}",
            facts=(
                ("building", f"{self.building.name}, {len(self.building.floors)} floors"),
                ("dampers", list_names(self.device_names)),
                ("sample time", f"{self.hardware.sample_time:g} s"),
                ("motions", list_names([ground.name for ground in self.grounds])),
                ("uses", uses_in_words([motion.facts.use for motion in self.motions])),
            ),
            tables=[Table(columns=("arrangement", "description"), rows=rows)],
            remarks=self.remarks,
        )


def uses_in_words(uses: Sequence[Use]) -> str:
    """Numbers of test and training motions in words, such as "16 test and 24 training motions"."""
    counts = {use: uses.count(use) for use in get_args(Use)}
    text = " and ".join(f"{count} {use}" for use, count in counts.items() if count)
    return f"{text} motion{'' if len(uses) == 1 else 's'}"


def constant_share(devices: Sequence[Device], share: float) -> ControlLaw:
    """The law with a constant command, a share of the largest command of each device."""
    # An actuator of any force has an infinite largest command.
    return constant_commands([share and share * device.largest_command for device in commanded(devices)])


def constant_commands(commands: ArrayLike) -> ControlLaw:
    """The law with constant commands, shape (n_devices,), or (n_candidates, n_devices) [A or V]."""
    return ControlLaw(name="passive", gains={"command": np.atleast_2d(commands)})


def study_fingerprint(study: Study) -> dict[str, object]:
    """Fingerprint of the inputs of a study, which must be equal for a journal to resume."""
    return {
        "arrangement": [
            {**named(arrangement.row, "label", "kind"), "content": digest_of_run(arrangement)}
            for arrangement in study.arrangements
            if not arrangement.added
        ],
        "motion": [
            {**named(motion.facts, "name", "use"), "content": _digest_of_motion(motion.ground)}
            for motion in study.motions
        ],
        "chosen_on": [_digest_of_motion(ground) for ground in study.chosen_on],
        "hardware": asdict(study.hardware),
        "realisations": None if study.realisations is None else study.realisations.digest,
        "version": {name: package_version(name) for name in ("mrwork", "numpy", "scipy")},
        **({"asked": study.asked} if study.asked else {}),
        **({"scored": study.scored} if study.scored != SCORE else {}),
    }


def digest_of_run(arrangement: Arrangement, *motions: GroundMotion) -> str:
    """Digest of all inputs of the runs of an arrangement, except the hardware."""
    law, inputs = arrangement.law, list[object]()
    if isinstance(law, ControlLaw):
        numbers = sorted({**law.gains, **law.tables}.items())
        inputs = [law.name, [(name, _digest(array)) for name, array in numbers], law.shaping]
        inputs += [law.largest_force] * math.isfinite(law.largest_force)
        inputs += [] if law.curve is None else [law.curve[0], _digest(law.curve[1])]
        inputs += [] if law.model is None else [_digest_of_loop(law.model.building, law.model.devices)]
    elif isinstance(law, UserLaw):
        inputs = [law.name, law.source, law.n_memory, law.rms_time]
    elif law is not None:
        inputs = [law.name, law.source]
    loop = _digest_of_loop(arrangement.building, arrangement.devices)
    return digest_of(loop, *inputs, *map(_digest_of_motion, motions))


def _digest_of_loop(building: Building, devices: Sequence[Device]) -> str:
    names = ["mass", "damping", "stiffness", "influence", "floors", "storeys"]
    names += ["loads", "heights"] if building.loads.any() else []
    return digest_of(
        *(_digest(getattr(building, name)) for name in names),
        *((_digest(element.row), element.numbers) for element in building.elements),
        *(
            (device.spec, _digest(device.draws), _digest(device.row), device.count, device.differential)
            for device in devices
        ),
        *(
            (place, _digest(device.sprung))
            for place, device in enumerate(devices)
            if device.sprung is not None
        ),
        *((device.largest_command, device.command) for device in devices),
    )


def _digest(numbers: ArrayLike) -> str:
    return digest_of(np.asarray(numbers, dtype=np.float64))


def _digest_of_motion(motion: GroundMotion) -> str:
    return digest_of(motion.dt, motion.acceleration, *[motion.forces] * bool(motion.forces.size))
