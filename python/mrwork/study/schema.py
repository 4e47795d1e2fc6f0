"""The values that a study is stated by: each table of a study file is one, which declares its keys and checks itself.

Numbers are in SI units. A number with a unit may also be given as a text with another unit, as "1 ms" or "0.1 g".
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from typing import Annotated, Any, ClassVar, Literal

from mrwork.base.arguments import NotNegative, Positive, checked
from mrwork.base.documents import heading_lines, key_lines, keys_in_words, prose_of
from mrwork.base.hints import Within
from mrwork.base.keys import (
    LARGEST_SEED,
    Arguments,
    given_in,
    key,
    keys_of,
    optional,
    positive,
    refuse_repeated,
    suggestion,
    tables,
    toml_value,
)
from mrwork.base.places import KeyPath, all_mistakes
from mrwork.base.summary import list_names
from mrwork.base.units import RATIOS, DriverUnit, number_in
from mrwork.buildings.from_file import BuildingTable
from mrwork.closed_loop.evaluation import SCORE, criterion
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.process_law import ProcessLaw
from mrwork.closed_loop.user_law import MOST_MEMORY, Command
from mrwork.control.laws.control_law import ControlLaw, StateOf
from mrwork.dampers.dependence import LawName
from mrwork.dampers.spec import DamperSpec
from mrwork.dampers.tested_range import FittedDamper
from mrwork.errors import InvalidSettingError, MrworkError
from mrwork.motions.ground_motion import HIGHEST_ORDER, GroundMotion
from mrwork.motions.roads import RoadClass
from mrwork.motions.spectral_density import CloughPenzien, KanaiTajimi
from mrwork.motions.synthetic import suite as synthetic_suite
from mrwork.motions.targets import ScaledBy, TargetSpectrum, asce_7_spectrum, en_1998_spectrum, table_spectrum
from mrwork.search.rules import LARGEST_POPULATION
from mrwork.study.row_kinds import Kind

Risk = Literal["mean", "max", "cvar"]
References = Literal["best_passive", "none"]
Baseline = Literal["passive_off", "best_passive"]
_Seed = Annotated[int, Within(least=0, most=LARGEST_SEED)]
# A factor must stay positive.
_Part = Annotated[float, Within(least=0.0, most=0.999)]
# What is usual: periods [s], steps of records [s], peaks of motions [m/s2] and commands [A or V].
_PERIODS, _STEPS, _PEAKS, _COMMANDS = (0.01, 12.0), (1e-5, 0.11), (0.5, 30.0), (0.02, 60.0)

Combination = Literal["mean", "largest"]


class CheckedTable:
    """A value that checks itself: `_mistakes` are sentences, each behind the keys that lead to what is wrong."""

    __slots__ = ()

    def __post_init__(self) -> None:
        refuse_repeated(self)
        with all_mistakes() as part:
            for keys, sentence in self._mistakes():
                with part():
                    raise InvalidSettingError(keys, sentence)

    def _mistakes(self) -> Iterator[tuple[str | KeyPath, str]]:
        raise NotImplementedError

    def command_in(self, key: str, unit: str) -> float | None:
        """The command of a key in the unit of the dampers; `None` if it is not given."""
        command: float | str | None = getattr(self, key)
        number = number_in(command, unit) if isinstance(command, str) else command
        if isinstance(number, str):
            raise InvalidSettingError(key, f"{key} {number}")
        return number


PASSIVE_OFF, PASSIVE_ON, OPTIMAL_PASSIVE = "Passive-off", "Passive-on", "Optimal passive"
BY_GROUP = f"{OPTIMAL_PASSIVE} by group"
"""Labels of the constant commands."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantLaw:
    """A constant command, which has no settings: a share of the largest, or the best one where `share` is `None`."""

    title: str
    description: str
    kind: Kind
    share: float | None = None


CONSTANT_LAWS: Mapping[str, ConstantLaw] = {
    "passive_off": ConstantLaw(title=PASSIVE_OFF, description="no command", kind="passive_off", share=0.0),
    "passive_on": ConstantLaw(title=PASSIVE_ON, description="the largest command", kind="passive", share=1.0),
    "best_passive": ConstantLaw(
        title=OPTIMAL_PASSIVE,
        description="the constant command of the lowest score over all motions, one share of each largest command",
        kind="best_passive",
    ),
    "best_passive_by_group": ConstantLaw(
        title=BY_GROUP,
        description="a constant command for each group of equal dampers, by coordinate search from best_passive",
        kind="best_passive_by_group",
    ),
}
"""Constant commands that a study accepts as laws, besides the laws of the registry, by name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertaintyTable:
    """What is not known exactly, as realisations: each law is simulated with all of them, beside the nominal study.

    The laws are designed for the nominal study. All laws and candidates are simulated with the same realisations.
    """

    realisations: int = key("number of realisations", default=16, least=1, most=10_000)
    damper: bool = key(
        "whether the parameters of identified dampers are drawn from the posterior of their run, of mrwork intervals "
        "--posterior",
        default=True,
    )
    stiffness: _Part = key(
        "half the range of a factor of the stiffness of the building, as 0.1 for +-10 %", default=0.0
    )
    damping: _Part = key("half the range of a factor of the damping of the building", default=0.0)
    delay: NotNegative = key("largest additional delay of the command", unit="s", default=0.0)
    seed: _Seed = key("seed of the realisations", default=0)


@checked
class TuneTable(CheckedTable):
    """Laws whose settings `mrwork tune` searches, each for itself, on the training motions of the study.

    A candidate is scored by the mean of its criteria over i = 0, under each motion and realisation; the risk
    takes one number of all these. With `relative_to = "best_passive"` and `combine = "largest"` a score below 1 says
    that the law is better than the best constant command in every criterion. Without `free`, each law has its own free
    settings with their ranges, see `mrwork help laws`, and the largest command of the law is one of them.
    """

    _made_by: ClassVar[str] = "mr.study.TuneTable(laws=...)"

    laws: tuple[str, ...] = key("names of the laws", default=())
    user: LawFileTable | None = optional("a law of the user that mr.own_law has made, instead of laws")
    label: str = key("appended to the titles of the laws in tables, by default tuned", default="")
    settings: Mapping[str, Any] | None = optional("settings that are held", file=True)
    free: Mapping[str, tuple[float, ...]] | None = optional(
        "settings to be searched, with lower and upper bounds, as { control_weight = [1e-15, 1e-9] }; an empty array "
        "for the range of the law. Of any law also largest_command, and dead_zone [m/s] and command_slope [A/s or V/s] "
        "of its command"
    )
    criteria: tuple[str, ...] | Mapping[str, Positive] = key(
        "criteria of the score, an array or a table with their weights; by default peak and rms of drift and "
        "acceleration; at a floor, storey or damper as rms_acceleration@body",
        default=(),
    )
    relative_to: Baseline = key(
        "what the criteria are divided by: criteria at i = 0, or under the best constant command",
        default="passive_off",
    )
    combine: Combination = key(
        "number of the weighted criteria of a run: their mean, or the largest", default="mean"
    )
    objectives: tuple[str, ...] = key(
        "criteria of a Pareto front beside the best of the score, by NSGA-II, which takes pymoo", default=()
    )
    risk: Risk = key(
        "number of all motions and realisations: their mean, the largest, or the mean of the worst share `tail`",
        default="mean",
    )
    tail: float | None = positive("share of the worst for cvar, up to 1, by default 0.2", most=1.0)
    constraints: Mapping[str, float | str] | None = optional(
        'upper limits of criteria under every motion, as { peak_stroke = "20 mm", rms_current = 0.5 }'
    )
    robust: bool = key("whether the realisations of [uncertainty] belong to the score", default=False)
    search: str = key(
        "search algorithm; cma (extra peers) for laws of many numbers, as signal_network",
        default="differential_evolution",
    )
    population: int = key("candidates of a generation", default=24, least=5, most=LARGEST_POPULATION)
    budget: int = key(
        "candidates of each law, apart from the first ones", default=384, least=5, most=LARGEST_POPULATION
    )
    gradient_steps: int = key(
        "steps of L-BFGS-B by exact gradients after the search, for laws that do not switch",
        default=0,
        least=0,
        most=10_000,
    )
    seed: _Seed = key("seed of the search, added to the seed of the command line", default=0)

    def _mistakes(self) -> Iterator[tuple[str | KeyPath, str]]:
        # Laws and searches take long to load, and most studies tune none.
        from mrwork.control.laws.law_settings import SETTINGS
        from mrwork.search.registry import ALL_OPTIMISERS

        if not (self.laws or self.user):
            yield "laws", "laws is empty; name the laws to be tuned, or give user for a law of your own"
        if self.user is not None and (self.laws or not self.user.law):
            yield (
                "user",
                "user takes a law that mr.own_law has made, and stands in place of laws; keep one of both",
            )
        for law in self.laws:
            if law not in SETTINGS:
                yield "laws", f"no control law is called {law!r}{suggestion(law, [*SETTINGS])}"
        if self.search not in ALL_OPTIMISERS:
            yield "search", f"no search is called {self.search!r}{suggestion(self.search, [*ALL_OPTIMISERS])}"
        if self.budget < self.population:
            needed = f"one generation takes {self.population} candidates"
            yield "budget", f"budget is {self.budget}, and {needed}; allow more"
        if self.tail is not None and self.risk != "cvar":
            sentence = f"tail has no effect on the risk {self.risk!r}"
            yield "tail", f'{sentence}; leave it out, or give risk = "cvar"'
        if len(self.objectives) == 1:
            yield "objectives", "objectives takes two criteria or more, each once; leave it out for a score"
        for setting in ("criteria", "objectives", "constraints"):
            yield from _unknown_criteria(setting, getattr(self, setting) or ())

    @property
    def judged_by(self) -> tuple[str, ...]:
        """Names of criteria that the table has."""
        return (*self.criteria, *self.objectives, *(self.constraints or ()))


def _unknown_criteria(setting: str, names: Iterable[str]) -> Iterator[tuple[str, str]]:
    for name in names:
        try:
            criterion(name)
        except MrworkError as error:
            yield setting, str(error)


Use = Literal["test", "training"]
"""Use of a motion: a controller is tuned on training motions and judged on test motions."""
Synthetic = Literal["kanai_tajimi", "clough_penzien", "iso_8608"]

# Angle of a damper that no drift stretches.
_UPRIGHT = 1.57
# Keys of a table that an actuator has.
_OF_ACTUATOR = {"storey", "actuator", "largest_force", "brace", "angle", "row", "name"}
# Of words with which a law would be given to some of the dampers.
_OF_ALL = (
    "{} in a [[{}]] would give one group of dampers a law of its own, and a law commands all of them; leave it out, "
    "several [[controller]] are compared with each other"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class BraceTable:
    """A brace in series with a damper."""

    stiffness: float = key("stiffness of the brace", unit="N/m", above=0.0)
    damping: float = key("damping of the brace", unit="N s/m", default=0.0, least=0.0)
    mass: float | None = positive(
        "mass of the joint between brace and damper; positive, by default negligible", unit="kg"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DamperTable(CheckedTable):
    """A damper across a storey: a published set, a run of `mrwork identify`, or given parameters.

    `count` equal dampers, twice as many if `differential`, are one group with one command. Parameters describe a
    single damper. Everything else means the whole group: forces in results and of the law, wanted and full forces,
    slopes and the control weight of a law, and a brace. Forces and strokes are along the damper, which is horizontal
    unless an `angle` or a `row` is given. With `actuator = true` an ideal actuator stands there; a law then commands
    actuators alone, and dampers beside them are passive or hold a command.
    """

    storey: int | str = key("storey of the damper: its number from 1, or its name")
    actuator: bool = key(
        "whether it is an ideal actuator, which exerts the force that the law active or a law in Python commands",
        default=False,
    )
    largest_force: float | None = positive(
        "force to either side at which an actuator saturates, by default none", unit="N"
    )
    preset: str | None = optional("published set, as kwok2006; see mrwork models NAME")
    run: str | FittedDamper | None = optional(
        "folder of an identified run, relative to the study file", file=True
    )
    like: str | None = optional(
        "of earlier versions, which had another model run in place of a damper of the user; it is passed over, and the "
        "damper of the run is simulated itself"
    )
    model: str | DamperSpec | None = optional(
        "model of the parameters, or of the preset if two models have one of that name"
    )
    model_file: str | None = optional(
        "file of a model of your own, which to_toml of a study writes, in place of the model", file=True
    )
    parameters: Mapping[str, float | tuple[float, ...]] | None = optional(
        "parameters, or changes to a preset or run: a number, or the coefficients of its law"
    )
    laws: Mapping[str, LawName] | None = optional(
        "laws of parameters in the command; by default several coefficients are a polynomial"
    )
    unit: DriverUnit | None = optional(
        "unit of the command, for given parameters, A by default; a preset and a run have their own"
    )
    lag: float | None = positive(
        "rate of the lag of the driver, instead of the rate of the preset", unit="1/s", usual=(1.0, 1e5)
    )
    largest_command: float | str | None = positive(
        "largest command of the driver, instead of the command of the preset or the largest tested one of the run",
        unit="A or V",
        usual=_COMMANDS,
    )
    command: float | str | None = optional(
        'command that the dampers hold, as "0.5 A", whatever a law sends', unit="A or V", least=0.0
    )
    passive: bool = key(
        "whether the damper is passive: required where no parameter depends on the command, as in a run without --law",
        default=False,
    )
    count: int = key(
        "number of equal dampers in parallel; forces, weights and slopes belong to the whole group",
        default=1,
        least=1,
    )
    differential: bool = key(
        "whether as many equal dampers act in opposition, with the same command", default=False
    )
    brace: BraceTable | None = optional("brace in series")
    angle: float | None = optional(
        "angle of the damper and its brace to the horizontal, as 38 deg: it is stretched by the drift times its cosine",
        unit="rad",
        least=0.0,
    )
    row: tuple[float, ...] | None = optional(
        "stretch of the damper over the coordinates of the building, a number for each, instead of the drift of its "
        "storey"
    )
    sprung: int | str | None = optional(
        "floor that is the sprung mass, as the body of a car: mixed_skyhook, acceleration_driven, skyhook_groundhook "
        "and decentralised_bang_bang read its absolute motion, by default that of the upper end less that of the lower"
    )
    rated_force: float | None = positive(
        "force that one damper is made for, beyond which runs are told; by default as the preset has it",
        unit="N",
    )
    rated_stroke: float | None = positive(
        "stroke to either side that one damper is made for; by default as the preset has it",
        unit="m",
        usual=(1e-3, 1.0),
    )
    name: str | None = optional("name in tables, by default the name of its storey")
    amplitude: tuple[float, ...] | None = positive(
        "smallest and largest expected damper displacement, for laws that need a static model of the damper",
        unit="m",
        usual=(1e-4, 1.0),
    )
    velocity: tuple[float, ...] | None = positive(
        "smallest and largest expected velocity, for the same laws", unit="m/s"
    )

    def _mistakes(self) -> Iterator[tuple[str | KeyPath, str]]:
        if self.actuator:
            for name in sorted(given_in(self).keys() - _OF_ACTUATOR):
                yield name, f"{name} is of a damper, and this is an actuator; leave it out"
            return
        if self.largest_force is not None:
            yield "largest_force", "largest_force is of an actuator; leave it out, or give actuator = true"
        if self.model == "ideal_actuator":
            yield "model", "ideal_actuator is no damper; give actuator = true in place of the model"
        if self.preset is not None and self.run is not None:
            yield (), "[[damper]] has a preset and a run; give one of them"
        if self.model_file is not None and (self.preset or self.run or self.model) is not None:
            yield "model_file", "model_file has the model of the parameters; leave preset, run and model out"
        if (self.preset or self.run or self.model or self.model_file) is None:
            yield (), "[[damper]] names no damper; give a preset, a run, or a model with parameters"
        if self.run is not None and self.model is not None:
            yield "model", "the run has its own model; leave model out"
        if self.angle is not None and self.row is not None:
            yield "row", "angle and row both say how the damper stands; keep one"
        if self.angle is not None and self.angle >= _UPRIGHT:
            angle = f"{self.angle:g} rad, {math.degrees(self.angle):.4g} deg"
            yield "angle", f'angle is {angle}; give one below 90 deg, as "38 deg"'
        for name, span in (("amplitude", self.amplitude), ("velocity", self.velocity)):
            if span is not None and (len(span) != 2 or span[0] > span[1]):
                yield name, f"{name} takes the smallest and the largest value, as [0.001, 0.01]"

    @staticmethod
    def _meant_by(name: str, _: Mapping[str, Any]) -> str:
        return _OF_ALL.format(name, "damper") if name in ("law", "controller") else ""


@dataclass(frozen=True, slots=True, kw_only=True)
class LawFileTable(CheckedTable):
    """A law of your own instead of one of the registry; see `mr.own_law` and `mr.closed_loop.UserLaw`.

    The file is run as Python when the study is read. It may import installed packages, but no other files: a study is
    resumed only if the text of this one is the same.
    """

    file: str | Command | ControlLaw = key("Python file of the law, relative to the study file", file=True)
    law: str = key("name in it of what mr.own_law has made, which has settings", default="")
    function: str = key(
        "function in it, of a LoopSample and the memory, that returns the commands, instead of law",
        default="",
    )
    memory: int = key(
        "numbers that each run keeps from sample to sample", default=0, least=0, most=MOST_MEMORY
    )
    rms_time: float | None = positive(
        "time constant of the running root mean squares of the readings, LoopSample.rms", unit="s"
    )

    def _mistakes(self) -> Iterator[tuple[str | KeyPath, str]]:
        if bool(self.law) == bool(self.function):
            both = "both law and function" if self.law else "neither law nor function"
            yield (
                (),
                f"user has {both}; give law for what mr.own_law has made, or function for a function of rows",
            )
        for name in ("memory", "rms_time"):
            if self.law and name in given_in(self):
                yield name, f"{name} is given to mr.own_law; leave it out"


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerTable(CheckedTable):
    """A control law; `mrwork help laws` lists them with their settings.

    The building without dampers and i = 0 are always simulated, and so is `best_passive`, the constant command with the
    lowest score, unless `references` is none; where different dampers follow commands, also `best_passive_by_group`.
    Further laws are `passive_off` and `passive_on`. Settings that a law needs and that are not given are taken from the
    response of the dampers, which the results tell. A weight may be a number, an array with one number for each floor,
    storey or state, or a symmetric matrix: rows of numbers, or the name of a .csv, .tsv or .txt file with them,
    relative to the study file. Forces, weights and slopes belong to all dampers of a [[damper]] together.
    """

    law: str = key("name of the law; required without user or process", default="")
    user: LawFileTable | None = optional("law in Python instead")
    process: ProcessLaw | None = optional("law outside Python instead")
    label: str = key("label in tables; by default the title of the law", default="")
    settings: Mapping[str, Any] | None = optional("settings of the law", file=True)
    gain: tuple[tuple[float, ...], ...] | str | None = optional(
        "finished gain K of the desired force f_c = -K s, for laws of a desired force, instead of weights among the "
        "settings: a row for each device, a column for each displacement [N/m] and then each velocity [N s/m] of the "
        "coordinates; rows of numbers, or a .csv, .tsv, .txt, .npy or .mat file relative to the study file",
        file=True,
    )
    state: StateOf | None = optional(
        "whether the velocities of the state that gains multiply are relative to the ground or absolute; by default "
        "absolute on roads, and relative under earthquakes and forces"
    )
    largest_command: float | str | None = positive(
        "largest command that this law may send, by default as the dampers have it; where some follow a current and "
        "others a voltage a share of the largest of each; of the law active, and for actuators, the force at which "
        'each saturates, as "50 kN"',
        unit="A or V or N",
    )
    dead_zone: NotNegative = key("damper velocity below which the command is zero", unit="m/s", default=0.0)
    command_slope: float | str = positive(
        "largest change of the command of this law per time, from sample to sample; of the law active, and for "
        "actuators, of each force",
        unit="A/s or V/s or N/s",
        default=math.inf,
    )

    def slope_in(self, unit: str) -> float:
        """The `command_slope` of commands in a unit; infinite where none is given."""
        slope = self.command_in("command_slope", f"{unit}/s")
        return math.inf if slope is None else slope

    def _mistakes(self) -> Iterator[tuple[str | KeyPath, str]]:
        if self.user is None and self.process is None and not self.law:
            yield (
                (),
                "[[controller]] has no law; give the name of a law, user for one in Python, or process for one outside "
                "of it",
            )
        owner, unread, shaping = self.law, list[str](), ["dead_zone", "command_slope"]
        if self.process is not None:
            owner, unread = "a law outside Python", ["law", "user", "settings", "gain", "state", *shaping]
        elif self.user is not None:
            owner, unread = "a law in Python", ["law", "settings", "gain", "state", *shaping]
            if self.user.law:
                owner, unread = "a law of the user", ["law", "gain", "state"]
        elif (constant := CONSTANT_LAWS.get(self.law)) is not None:
            unread = ["settings", "gain", "state", *(shaping if constant.share is None else ())]
        for name in (name for name in unread if name in given_in(self)):
            yield name, f"{owner} has no {name}; leave it out"

    @staticmethod
    def _meant_by(name: str, table: Mapping[str, Any]) -> str:
        if name in ("damper", "dampers", "storey", "storeys", "group"):
            return _OF_ALL.format(name, "controller")
        # Laws take long to load, and every study has its names.
        from mrwork.control.laws.law_settings import SETTINGS

        kind = SETTINGS.get(str(table.get("law")))
        if kind is None or name not in [entry.name for entry in keys_of(kind)]:
            return ""
        return (
            f"{name} is a setting of the law; it stands in [controller.settings], or below the law as settings = "
            f"{{ {name} = {toml_value(table[name])} }}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class BaselineTable:
    """The building with other devices for comparison: passive dampers, a tuned mass or liquid, isolation."""

    label: str = key("label in tables")
    building: BuildingTable = key("keys of [building] to be replaced or added")


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetTable:
    """Target spectrum that motions are scaled to by `scale_to`, and that the suite of test motions is checked against.

    A code gives it, or a table of periods and accelerations.
    """

    code: Literal["en_1998", "asce_7"] | None = optional("code of the spectrum: EN 1998-1 or ASCE 7-16")
    period: float | None = positive(
        "period of scale_to and of the range of the check, 0.2 to 2 times as long; by default the first period of "
        "[building], before dampers",
        unit="s",
    )


_TARGETS: dict[str | None, Callable[..., TargetSpectrum]] = {
    "en_1998": en_1998_spectrum, "asce_7": asce_7_spectrum, None: table_spectrum,
}  # fmt: skip


def target_spectrum(table: Arguments) -> TargetSpectrum:
    """The spectrum of a table [target]: of its `code`, or without one of its own points; other keys are refused."""
    code = table.given.get("code")
    reason = f"is no key of a target {f'of the code {code}' if code else 'without code, which is a table'}"
    remedy = "leave it out" if code else "leave it out, or give the code"
    table.refuse_others((TargetTable, _TARGETS[code]), reason, remedy)
    spectrum: TargetSpectrum = replace(table, functions=(_TARGETS[code],)).call()()
    return spectrum


GROUNDS = ("file", "acceleration", "synthetic", "suite", "road")
"""Keys of which one says how the ground moves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionTable(CheckedTable):
    """Ground motions from files, synthetic or a suite, forces on floors, or both; each factor or level is a motion.

    A road is the ground under the tyre of a vehicle: its heights, or a class of ISO 8608, at a speed. Training and test
    motions must be different records: files and accelerations are compared.
    """

    file: str | GroundMotion | None = optional(
        "record: .AT2, .csv, .mat and others, relative to the study file; of a folder, or a pattern as records/*.AT2, "
        "every record is a motion",
        file=True,
    )
    acceleration: tuple[float, ...] | None = optional(
        "samples instead of a file, every dt, in m/s2 or the unit"
    )
    force: str | None = optional(
        "forces on floors, alone or beside the ground, a table relative to the study file: a column for each floor by "
        "its name, or one column with floor or shape",
        file=True,
    )
    forces: tuple[tuple[float, ...], ...] | None = optional(
        "samples of the force on each floor, every dt in N or the unit; beside the ground in N, as many as it has"
    )
    floor: int | str | None = optional("floor of the one column of a force, by its name or number from 1")
    shape: tuple[float, ...] | None = optional("share of each floor in the one column of a force")
    road: str | None = optional(
        "heights of a road instead of a record, over distances or times, relative to the study file",
        file=True,
    )
    speed: float | None = positive(
        'speed of the vehicle on a road, as "72 km/h": over distances, and of iso_8608',
        unit="m/s",
        usual=(0.5, 60.0),
    )
    synthetic: Synthetic | None = optional("filtered noise instead of a file, or iso_8608 for a random road")
    road_class: RoadClass | None = optional("class of the road iso_8608; C is an average one")
    suite: Arguments | None = optional(
        "many synthetic motions instead of a file", functions=(synthetic_suite,)
    )
    name: str = key("name in tables; of several records or a suite, the beginning of their names", default="")
    group: str | tuple[str, ...] = key(
        "group of the motions, or several, of which tables have the score", default=""
    )
    unit: str | None = optional(
        "unit of the acceleration in the file, as g, of forces, as kN, or of the heights of a road; needed if the file "
        "does not state it"
    )
    column: str | None = optional("column or variable of the acceleration or height, if there are several")
    channel: int | None = optional("channel of a file with several, from 1", least=1)
    dt: float | None = positive(
        "step of synthetic motions, by default 0.01 s, of a road 0.001 s; of samples, or of a table without times",
        unit="s",
        usual=_STEPS,
    )
    duration: float | None = positive(
        "length of a synthetic motion, 30 s by default", unit="s", usual=(0.3, 3600.0)
    )
    seed: _Seed = key(
        "seed of a synthetic motion or a suite, added to the seed of the command line", default=0
    )
    soil: Arguments | None = optional(
        "soil of a synthetic motion, firm by default", functions=(KanaiTajimi, CloughPenzien)
    )
    factor: float | tuple[float, ...] | None = optional("factor of the amplitude, also after scale_to")
    pga: float | tuple[float, ...] | None = optional(
        "peak that the motion is scaled to", unit="m/s2", usual=_PEAKS
    )
    sa: float | tuple[float, ...] | None = optional(
        "spectral acceleration that the motion is scaled to: pseudo-acceleration at sa_period and sa_damping",
        unit="m/s2",
        # From 0.067 g on, as S_D1 in ASCE/SEI 7-16, Table 11.6-2.
        usual=(0.65, 80.0),
    )
    sa_period: float | None = positive(
        "period of the spectral acceleration, by default the first period of [building], before dampers",
        unit="s",
        usual=_PERIODS,
    )
    sa_damping: _Part | None = optional(
        "damping ratio of the spectral acceleration, 0.05 by default", usual=RATIOS
    )
    scale_to: ScaledBy | None = optional(
        "what becomes as in [target]: pga; sa at its period; least_squares, Sa from 0.2 to 2 times its period"
    )
    time_scale: float = positive("factor of the time axis", default=1.0)
    start: NotNegative = key("start of the part that is used, from the first sample", unit="s", default=0.0)
    end: float | None = positive("end of the part that is used, from the first sample", unit="s")
    baseline: int | None = optional(
        "order of the polynomial of the baseline correction", least=0, most=HIGHEST_ORDER
    )
    resample: float | None = positive("step that the motion is resampled to", unit="s")
    rest: float = key("time at rest appended to the motion", unit="s", default=0.0, least=0.0)
    use: Use = key("use: controllers are tuned on training motions, judged on test motions", default="test")

    def _mistakes(self) -> Iterator[tuple[str | KeyPath, str]]:
        grounds = [name for name in GROUNDS if getattr(self, name) is not None]
        forces = [name for name in ("force", "forces") if getattr(self, name) is not None]
        names_road = self.is_drawn_road or (not (grounds or forces) and self.road_class is not None)
        if not (grounds or forces or names_road):
            of_road = '; its speed is of a road, or of synthetic = "iso_8608"' if self.speed else ""
            yield (
                (),
                "[[motion]] needs a file, samples, a synthetic motion, a suite, a road or forces; forces may act "
                f"beside one of the others{of_road}",
            )
        for ways in (grounds, forces):
            if len(ways) > 1:
                yield ways[1], f"[[motion]] has {' and '.join(ways)}; keep one, or give each a [[motion]]"
        keys = [name for name in ("factor", "pga", "sa", "scale_to") if getattr(self, name) is not None]
        if len(keys) > 1 and keys != ["factor", "scale_to"]:
            says = "a motion is scaled by factor, pga, sa or scale_to, of which only scale_to takes a factor, too"
            yield keys[1], f"{says}; keep one of {list_names(keys)}"
        # What is read depends on what moves.
        for unread, names, reason in self._unread() if grounds or forces else ():
            yield from (
                (name, f"{name} {reason}") for name in names.split() if unread and name in given_in(self)
            )
        if self.force is not None and self.floor is not None and self.shape is not None:
            yield "shape", "floor and shape both say where the one column of a force acts; keep one"
        of_samples = self.acceleration is not None
        if (of_samples or (self.forces is not None and self.ground is None)) and self.dt is None:
            yield (), f"[[motion]] has no dt of its {'samples' if of_samples else 'forces'}; give it [s]"
        wanted = ("synthetic", "road_class", "speed") if names_road else ()
        if lacking := " and no ".join(name for name in wanted if getattr(self, name) is None):
            yield (
                (),
                f"a random road has no {lacking}; give all three, "
                'as synthetic = "iso_8608", road_class = "C", speed = "72 km/h"',
            )

    def _unread(self) -> Iterator[tuple[bool, str, str]]:
        """Whether names of keys go unread, these names, and why, with what to do."""
        made, drawn, file, of_force = self.is_synthetic, self.is_drawn_road, self.file, self.force is not None
        is_value, leave = isinstance(file, GroundMotion), "; leave it out"
        is_road = drawn or self.road is not None or (isinstance(file, GroundMotion) and file.is_road)
        yield (
            self.is_forced,
            "pga sa scale_to baseline",
            "is of ground accelerations, and this motion has forces on floors; leave it out, or scale by factor",
        )
        yield not of_force, "floor shape", "is of the one column of a force; give that force, or leave it out"
        yield (
            (of_force or self.forces is not None) and self.ground is None,
            "column channel",
            f"is of records, and columns of forces are named by their floors{leave}",
        )
        names_road = self.road_class is not None
        yield (
            not drawn,
            "road_class speed" if names_road and not self.road else "road_class",
            'is of a synthetic road; leave it out, or give synthetic = "iso_8608"',
        )
        yield not (drawn or self.road or names_road), "speed", f"is of roads, and this motion is none{leave}"
        yield drawn, "soil", f"is of filtered noise, and this is a road{leave}"
        yield self.road is not None, "channel", f"is for records, and this is a road{leave}"
        yield (
            is_road,
            "pga sa scale_to",
            "is a level of earthquakes, and a road has none; leave it out, or give factor, which scales heights",
        )
        yield is_road, "baseline", f"is of records, and heights of a road have no drift of a baseline{leave}"
        yield is_road, "start", "would tilt the road, whose part begins level; cut the profile itself"
        yield is_road, "time_scale", "changes times and not heights; give another speed"
        yield self.sa is None, "sa_period sa_damping", f"is of sa, which this motion does not have{leave}"
        yield not made, "duration soil seed", f"is of synthetic motions, and this one is given{leave}"
        yield (
            bool(self.suite),
            "duration soil",
            f"is for a single synthetic motion, and this is a suite{leave}",
        )
        yield made, "unit column channel", f"is for files, and this motion is synthetic{leave}"
        yield (
            self.acceleration is not None,
            "column channel",
            f"is for files, and this motion is given by its samples{leave}",
        )
        yield is_value, "unit dt column channel", f"is for files, and this motion is a GroundMotion{leave}"

    @property
    def is_drawn_road(self) -> bool:
        """Whether it is a random road."""
        return self.synthetic == "iso_8608"

    @property
    def ground(self) -> str | None:
        """The key that has the motion of the ground, `None` where forces act alone."""
        return next((name for name in GROUNDS if getattr(self, name) is not None), None)

    @property
    def is_forced(self) -> bool:
        """Whether it has forces on floors."""
        of_motion = isinstance(self.file, GroundMotion) and bool(self.file.forces.size)
        return of_motion or self.force is not None or self.forces is not None

    @property
    def is_synthetic(self) -> bool:
        """Whether it is generated, alone or as a suite."""
        return self.synthetic is not None or self.suite is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacesTable:
    """Places of equal dampers that `mrwork tune` compares, each with its best constant command, before it tunes laws.

    All placements, up to 60, are ranked on the training motions and judged on the test motions. Laws are tuned at the
    best one.
    """

    dampers: int | None = optional(
        "number of dampers, each as the [[damper]] with its count; by default as many as there are [[damper]]",
        least=1,
        most=1000,
    )
    storeys: tuple[int | str, ...] | None = optional("storeys that they may stand in, by default all")
    each: int | None = optional("most of them in a storey, by default all", least=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportTable(CheckedTable):
    """Figures in detail on the page, and columns of tables."""

    motion: str | None = optional(
        "motion of the time histories and force loops; by default the test motion of the largest peak"
    )
    controllers: tuple[str, ...] = key(
        "labels of the arrangements drawn there, by default all; of more than 24, the best are drawn",
        default=(),
    )
    criteria: tuple[str, ...] = key(
        "further columns of the tables of values: criteria at a floor, storey or damper, as rms_acceleration@body, and "
        "weighted_acceleration, which is weighted by W_k of ISO 2631-1 and takes histories",
        default=(),
    )
    score: tuple[str, ...] = key(
        "criteria of the score, the mean of their ratios to i = 0, by which the best constant command is chosen, "
        "arrangements are ranked and, unless it has criteria, [[tune]] searches; by default peak and RMS drift and "
        'acceleration, for a car as ["weighted_acceleration@body", "rms_drift@tyre"]',
        default=SCORE,
    )
    histories: Literal["detailed", "all", "none"] = key(
        "histories to be stored: of the motion drawn in detail, of all motions, or none", default="detailed"
    )
    limit: Mapping[str, float | str] | None = optional(
        "criterion with its limit, of which the page has the fragility where records have several levels, as "
        '{ peak_drift_ratio = "1 %" }; by default drift_limit of [building], else collapse, 10 %'
    )

    def _mistakes(self) -> Iterator[tuple[str | KeyPath, str]]:
        yield from _unknown_criteria("criteria", self.criteria)
        unknown = [*_unknown_criteria("score", self.score)]
        yield from unknown
        for name in () if unknown else self.score:
            if criterion(name).of_command:
                yield "score", f"{name} is zero at i = 0, over which the score is; leave it out"


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyTable:
    """A building, its dampers, control laws and ground motions."""

    title: str = key("heading of the page", default="")
    folder: str = key(
        "folder that names of files are relative to, by default the folder of the study file", default=""
    )
    building: BuildingTable = key("the building")
    damper: tuple[DamperTable, ...] = key(
        "dampers, each with a model, parameters, laws and a largest command of its own", default=()
    )
    controller: tuple[ControllerTable, ...] = key("control laws", default=())
    baseline: tuple[BaselineTable, ...] = key("other devices for comparison", default=())
    motion: tuple[MotionTable, ...] = key("ground motions")
    design_level: float | None = positive(
        "level of the motions on which laws are designed and the best constant command is chosen, to be kept at all "
        "others: one of their pga, sa or factor; by default every level",
        unit="m/s2",
    )
    target: Arguments | None = optional(
        "target spectrum of the motions", functions=(TargetTable, *_TARGETS.values())
    )
    references: References = key(
        "what laws are compared with besides i = 0: the best constant command of the dampers, added where the study "
        "does not list it, or none",
        default="best_passive",
    )
    hardware: Hardware = key("the loop around the law", default=Hardware())
    report: ReportTable = key("figures on the page", default=ReportTable())
    uncertainty: UncertaintyTable | None = optional("what is not known exactly")
    tune: tuple[TuneTable, ...] = key("laws to be tuned, by mrwork tune", default=())
    places: PlacesTable | None = optional("places of the dampers to be compared, by mrwork tune")


def schema_text() -> str:
    """Every table with its keys, their meanings, units and defaults, for `mrwork help study`."""
    return "\n\n".join(
        "\n".join([*heading_lines(heading or "at the top", prose_of(kind)), *key_lines(keys_in_words(kind))])
        for heading, kind in tables(StudyTable)
    )


def laws_text() -> str:
    """Every control law with its equation, source and settings, for `mrwork help laws`.

    What several laws have stands once, below.
    """
    # Laws take long to load, and the keys of a study have none.
    from mrwork.control.laws.control_law import control_laws
    from mrwork.control.laws.law_settings import SETTINGS
    from mrwork.control.laws.weights import WeightWishes

    keys = {spec: keys_in_words(SETTINGS[spec.name]) for spec in control_laws()}
    shared = [key for key, count in Counter(chain(*keys.values())).items() if count > 1]
    blocks = []
    for spec, of_law in keys.items():
        prose = [spec.description, spec.source]
        prose += ["It switches, so its score has no gradient."] if spec.switches else []
        actuators = "It commands actuators, [[damper]] actuator = true, or one in the place of each damper."
        prose += [actuators] if spec.commands_force else []
        if elsewhere := [key.name for key in of_law if key in shared]:
            prose.append(f"settings described below: {', '.join(elsewhere)}")
        below = [line for text in prose for line in heading_lines("", text)[1:]]
        if unique := [key for key in of_law if key not in shared]:
            below += ["  settings", *_indented(key_lines(unique))]
        blocks.append([f"{spec.name}: {spec.title}", *_indented(spec.equation.splitlines()), *below])
    blocks.append(["Settings of several laws", *key_lines(shared)])
    heading = "designed: table among the settings of a law with weights"
    wishes = _indented(key_lines(keys_in_words(WeightWishes)))
    blocks.append([*heading_lines(heading, WeightWishes.__doc__ or ""), *wishes])
    blocks += [[f"{name}: {law.description}; no settings"] for name, law in CONSTANT_LAWS.items()]
    return "\n\n".join("\n".join(block) for block in blocks)


def _indented(lines: Iterable[str]) -> list[str]:
    return [f"  {line}" for line in lines]
