"""Named numeric columns of a file, and what the name of a column means: its quantity, its unit, the option for it."""

from __future__ import annotations

import re
import shlex
import unicodedata
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.base.keys import closest
from mrwork.base.summary import list_names
from mrwork.base.units import FACTORS, CommandUnit, MeasuredQuantity, quantity_of, spelt_command_unit
from mrwork.base.values import Floats
from mrwork.errors import RecordError
from mrwork.files.layout import numbered_names

TestQuantity = Literal["time", "displacement", "velocity", "force", "current", "voltage"]

# Characters of a column's name; nothing is told from a longer one.
_LONGEST_NAME: Final = 300


@dataclass(frozen=True, slots=True, kw_only=True)
class TestRole:
    """Role of a column of a damper test: words that mean it, and what a message proposes where a file does not say it.

    `sensors` count where no column has one of the words. `units` are from the smallest numbers to the largest, each up
    to a size in it: half the peak to peak of a motion and of a force, the step of the time, the largest command; the
    limits lie between what rigs measure in the two units. `example` is a heading.
    """

    words: frozenset[str]
    units: tuple[tuple[str, float], ...]
    example: str
    sensors: frozenset[str] = frozenset()
    is_required: bool = False


# Set point of the driver, in amperes or volts: the unit decides.
_COMMAND: Final = frozenset({"command", "cmd", "setpoint"})
# `v` and `u` have different meanings on different rigs; the unit after them decides. Programs of rigs write the names
# in the language of their user: English, German, Spanish, French, Japanese, Chinese.
TEST_ROLES: Final[Mapping[TestQuantity, TestRole]] = {
    "time": TestRole(
        words=frozenset({
            "time", "t", "zeit", "uhrzeit", "tiempo", "hora", "temps", "heure", "時間", "時刻", "时间",
        }),
        sensors=frozenset({"timestamp", "datetime"}),
        units=(("s", 0.1), ("ms", 50.0), ("us", np.inf)),
        example="t_s",
        is_required=True,
    ),
    "displacement": TestRole(
        words=frozenset({
            "displacement", "disp", "displ", "stroke", "position", "pos", "x", "u", "extension",
            "elongation", "deflection", "weg", "hub", "verschiebung", "auslenkung", "verformung",
            "desplazamiento", "carrera", "posición", "posicion", "déplacement", "deplacement", "course",
            "変位", "変位量", "ストローク", "位置", "位移", "行程",
        }),
        sensors=frozenset({"lvdt", "laser"}),
        units=(("m", 0.2), ("mm", 2000.0), ("um", np.inf)),
        example="displacement_mm",
        is_required=True,
    ),
    "velocity": TestRole(
        words=frozenset({
            "velocity", "vel", "v", "speed", "geschwindigkeit", "velocidad", "vitesse", "速度",
        }),
        units=(("m/s", 4.0), ("mm/s", np.inf)),
        example="velocity_mps",
    ),
    "force": TestRole(
        words=frozenset({
            "force", "load", "f", "kraft", "last", "fuerza", "carga", "effort", "charge", "荷重", "力",
            "抗力", "载荷", "荷载", "載荷", "阻尼力",
        }),
        sensors=frozenset({"cell"}),
        units=(("kN", 20.0), ("N", np.inf)),
        example="force_N",
        is_required=True,
    ),
    "current": TestRole(
        words=frozenset({
            "current", "i", "amps", "ampere", "amperes", "strom", "corriente", "courant", "intensité",
            "電流", "电流", *_COMMAND,
        }),
        sensors=frozenset({"shunt"}),
        units=(("A", 20.0), ("mA", np.inf)),
        example="current_A",
    ),
    "voltage": TestRole(
        words=frozenset({
            "voltage", "volt", "v", "u", "spannung", "voltaje", "電圧", "电压", "電壓", *_COMMAND,
        }),
        # In English a force.
        sensors=frozenset({"tension", "tensión"}),
        units=(("V", 50.0), ("mV", np.inf)),
        example="voltage_V",
    ),
}  # fmt: skip
QUANTITIES: Final[tuple[TestQuantity, ...]] = tuple(TEST_ROLES)
# German joins words, and Japanese and Chinese have no blanks: Kolbenweg, Dämpferkraft, 減衰力. The first are other
# quantities: thrust, acceleration, pressure, stress and power.
_AT_END_OF_COMPOUNDS: Final = (
    "schub", "加速度", "圧力", "压力", "壓力", "応力", "应力", "電力",
    "zeit", "weg", "hub", "verschiebung", "geschwindigkeit", "kraft", "last", "strom", "spannung",
    *(word for role in TEST_ROLES.values() for word in sorted(role.words) if word > "\u2e80"),
)  # fmt: skip
ASIAN_WORDS: Final = frozenset(word for word in _AT_END_OF_COMPOUNDS if not word.isascii())
"""Words for quantities that tell the encoding of a text."""
# Words in the name of a column of which the quantity is no sample of the measured signal.
_NOT_MEASURED: Final = frozenset({
    "command", "commanded", "setpoint", "set", "target", "demand", "reference", "ref", "desired",
    "soll", "sollwert", "führungs", "consigne", "consigna", "目標", "指令", "设定", "目标", "error",
    "limit", "min", "max", "minimum", "maximum", "peak", "valley",
    "mean", "rms", "count", "cycle", "cycles", "segments", "offset", "date", "stamp", "of",
})  # fmt: skip
# Only with these words is a voltage or current the command of the damper, and not the signal of a sensor.
_OF_COMMAND: Final = frozenset({
    "command", "commanded", "setpoint", "set", "point", "target", "demand", "coil", "damper", "mr",
    "mrd", "drive", "driver", "applied", "control", "input", "excitation", "spule", "bobina",
    "spulen", "soll", "sollwert", "steuer", "treiber", "dämpfer", "erreger", "bobine", "コイル", "励磁", "線圈", "线圈",
    "制御", "控制", "駆動", "驱动", "阻尼器", "減振器", "ダンパ", "ダンパー",
})  # fmt: skip
# A reading of the current or voltage that was sent: it counts where the command itself is in no column.
_MEASURED: Final = frozenset({
    "feedback", "fb", "actual", "act", "measured", "meas", "readback", "monitor", "real", "ist", "istwert", "gemessen",
    "valve", "ventil", "solenoid", "magnet", "cdc", "mesuré", "medida", "medido", "実測", "实测", "反馈",
})  # fmt: skip
# With these words a voltage is the voltage of the coil, and not the signal of a sensor.
_OF_DRIVER: Final = frozenset(
    {"coil", "driver", "spule", "spulen", "bobina", "bobine", "コイル", "線圈", "线圈"}
)
# Beside those words, what sets the force of a damper that follows no current or voltage.
_SCALAR_COMMANDS: Final = _COMMAND | {
    "valve", "opening", "orifice", "needle", "gap", "control", "pwm", "duty", "pilot",
}  # fmt: skip
# Units of commands that other channels of a rig seldom have.
_ASKED_UNITS: Final = frozenset({"%", "bar", "psi", "T", "mT"})
_BESIDE_SCALARS: Final = frozenset({"pressure", "cycle", "ratio"})
# A column with one of these words is neither a motion nor a force nor a time, whatever its unit.
_OF_OTHERS: Final = frozenset({
    "mass", "masse", "masa", "weight", "gewicht", "peso", "poids", "height", "höhe", "altura", "hauteur", "length",
    "länge", "longitud", "longueur", "width", "breite", "thickness", "dicke", "diameter", "durchmesser", "diámetro",
    "area", "fläche", "rpm", "revs", "drehzahl", "torque", "drehmoment", "couple", "トルク", "扭矩",
    "temperature", "temperatur", "temperatura", "température", "pressure", "druck", "presión",
    "pression", "stress", "spannung", "strain", "dehnung", "angle", "winkel", "power", "energy", "strength",
    "質量", "重量", "高さ", "直径", "温度", "圧力", "质量", "高度",
})  # fmt: skip
# A word, optionally followed by a separator and a unit: force_kN, Force (kN), "v [m/s]", disp/mm.
_NAME: Final = re.compile(r"\s*([^\W\d_]+)(?:[\s_\-/,:.(\[]+(.*?)[)\]]?)?\s*")
# Several words before the unit: Axial Force (kN), load_cell_kN, Position(Linear:Digital Position) (mm).
# "Laser (in mm)" has its unit after a word.
_BRACKETED: Final = re.compile(r"(.*?)\s*[(\[{]\s*(?:(?:in|units?:?)\s+)?([^()\[\]{}]*?)\s*[)\]}]\s*")
_SEPARATOR: Final = re.compile(r"[\s_,:/\-]+")
_WORD: Final = re.compile(r"[A-ZÀ-Þ]?[a-zß-ÿ]+|[A-ZÀ-Þ]+(?![a-zß-ÿ])|[\u3005\u3040-\u30ff\u3400-\u9fff]+")


# Units that stand for a quantity by themselves; of one letter, as A and N, they may be anything.
_UNITS_AS_NAMES: Final = frozenset({"amps", "ampere", "amperes", "volts"})


def plain_name(name: str) -> str:
    """A name with one way to write each character, and single blanks; empty where it is too long to be a name."""
    return "" if len(name) > _LONGEST_NAME else " ".join(unicodedata.normalize("NFKC", name).split())


def unit_in_name(quantity: TestQuantity, name: str) -> str | None:
    """Unit text of a column whose name means the quantity, alone or among words, empty if none; else `None`."""
    if (unit := _unit_of_word(name, TEST_ROLES[quantity].words | TEST_ROLES[quantity].sensors)) is not None:
        return unit
    words, at_end = words_and_unit(name)
    tokens = _words(words)
    stems = _long_stems(quantity) | TEST_ROLES[quantity].sensors
    others = tokens - stems
    if quantity in ("current", "voltage"):
        # A letter is enough beside words of a command: I_set, U_cmd.
        letters = TEST_ROLES[quantity].words - stems
        is_named = tokens & stems or (tokens & letters and len(tokens) > 1)
        # Coil (A) and driver_V, which are no sensor's.
        in_own_unit = quantity == quantity_of(at_end) and (quantity == "current" or tokens & _OF_DRIVER)
        is_named = is_named or (tokens and in_own_unit)
        # What a shunt shows in volts is no command.
        is_sensed = tokens & TEST_ROLES[quantity].sensors and quantity_of(at_end) not in (None, quantity)
        is_command = others - letters <= _OF_COMMAND | _MEASURED
        return at_end if is_named and is_command and not is_sensed else None
    return at_end if tokens & stems and not others & _NOT_MEASURED else None


def is_of_another(name: str, quantity: MeasuredQuantity) -> bool:
    """Whether a word of a name is of another quantity than this one."""
    tokens = _words(words_and_unit(name)[0])
    stems = {other: tokens & _long_stems(other) for other in QUANTITIES if other != quantity}
    is_own = quantity in QUANTITIES and tokens & _long_stems(quantity)
    return bool(tokens & _OF_OTHERS) or (not is_own and any(stems.values()))


def scalar_unit_in_name(name: str, apart: str = "") -> CommandUnit | None:
    """Unit of a column whose name means a command that is neither a current nor a voltage; else `None`.

    Such as ``valve_mm``, ``Valve Opening (%)``, ``setpoint_psi`` and ``command [deg C]``. `apart` is a unit that the
    file states beside the name. A name of further words, as ``Axial Command (mm)``, means a command of the rig.
    """
    words, at_end = words_and_unit(name)
    match = _NAME.fullmatch(plain_name(name))
    for phrase, text in ((words, at_end), (match[1], match[2] or "") if match else ("", ""), (name, apart)):
        unit, tokens = spelt_command_unit(text), _words(phrase)
        if (
            unit
            and tokens & _SCALAR_COMMANDS
            and not tokens - _SCALAR_COMMANDS - _OF_COMMAND - _BESIDE_SCALARS
        ):
            return unit
    return None


def may_be_a_command(name: str, apart: str = "") -> bool:
    """Whether a column has a unit of commands and no name of a motion, a force or a sensor of these."""
    unit = words_and_unit(name)[1] or apart
    tokens = _words(words_and_unit(name)[0])
    of_motion = [tokens & (_long_stems(other) | TEST_ROLES[other].sensors) for other in QUANTITIES[:4]]
    return (quantity_of(unit) in ("current", "voltage") or unit in _ASKED_UNITS) and not any(of_motion)


def is_second_choice(quantity: TestQuantity, name: str) -> bool:
    """Whether a name counts only where no other does: of a sensor, of a measured command, or as I_set."""
    tokens = _words(words_and_unit(name)[0])
    is_measured = quantity in ("current", "voltage") and bool(tokens & _MEASURED)
    return is_measured or not (is_plain(quantity, name) or tokens & _long_stems(quantity))


def _long_stems(quantity: TestQuantity) -> frozenset[str]:
    return frozenset(stem for stem in TEST_ROLES[quantity].words if len(stem) > 1 or not stem.isascii())


def find_column(column: str, names: Sequence[str], source: str) -> str:
    """The one name equal to `column`, or else equal except for case, or for its unit; or the name with that number."""
    wanted = plain_name(column).casefold()
    alike = (
        [name for name in names if name == column]
        or [name for name in names if plain_name(name).casefold() == wanted]
        or [name for name in names if words_and_unit(name)[0].strip().casefold() == wanted]
        or ([names[int(wanted) - 1]] if wanted in numbered_names(len(names)) else [])
    )
    # Of equal headings each has its number in front.
    alike = alike or [name for name in names if name.partition(" ")[2].casefold() == wanted]
    if len(alike) == 1:
        return alike[0]
    if alike:
        quoted = list_names([f"'{name}'" for name in alike])
        raise RecordError(
            f"{source}: '{column}' may be {quoted}; give the whole heading, or the number of the column"
        )
    shown = ", ".join(f"'{name}'" for name in names)
    near = closest(column, names)
    columns = f", did you mean '{near}'" if near else f"; the columns are {shown}"
    raise RecordError(f"{source}: there is no column '{column}'{columns}")


def words_and_bracket(name: str) -> tuple[str, str]:
    """The words of a column's name, and what stands in brackets or behind the last separator, whether a unit or not."""
    match = _BRACKETED.fullmatch(plain_name(name))
    if match is not None:
        return match[1], match[2]
    words, _, last = plain_name(name).rpartition("_")
    return (words, last) if words else (last, "")


def is_set_point(name: str) -> bool:
    """Whether a word of a name says that it is no sample of a measured signal, as a set point or a mean."""
    return bool(_words(words_and_bracket(name)[0]) & _NOT_MEASURED)


def words_and_unit(name: str) -> tuple[str, str]:
    """The words of a column's name, and the unit in brackets or at its end; empty where there is none."""
    name = plain_name(name)
    match = _BRACKETED.fullmatch(name)
    if match is not None:
        return match[1], match[2]
    if name.casefold() in _UNITS_AS_NAMES:
        return name, name
    for separator in _SEPARATOR.finditer(name):
        if quantity_of(name[separator.end() :]) is not None:
            return name[: separator.start()], name[separator.end() :]
    return name, ""


def _words(text: str) -> frozenset[str]:
    """The words of a text, in small letters; compound ones as their last and what is before it."""
    words = [word.casefold() for word in _WORD.findall(text)]
    parts: set[str] = set()
    for word in words:
        ends = [stem for stem in _AT_END_OF_COMPOUNDS if word.endswith(stem)]
        last = max(ends, key=len, default=word)
        parts |= {last, word.removesuffix(last)}
    return frozenset(parts - {""})


def _unit_of_word(name: str, stems: frozenset[str]) -> str | None:
    """Unit text of a name of one word, which is one of the stems; `None` for other names."""
    match = _NAME.fullmatch(plain_name(name))
    if match is None or match[1].casefold() not in stems:
        return None
    rest = (match[2] or "").strip()
    words = (
        re.search(r"[\s(\[]", rest) or _words(rest) & _NOT_MEASURED or quantity_of(words_and_unit(name)[1])
    )
    return rest if quantity_of(rest) is not None or not words else None


def is_plain(quantity: TestQuantity, name: str) -> bool:
    """Whether a name has one word, besides a unit."""
    return _unit_of_word(name, TEST_ROLES[quantity].words) is not None


ReadColumn = Callable[[str], Floats | None]
"""Reads a column by its name; `None` where it does not have numbers."""

# A column of so few values is a count or a state, no motion and no force.
_FEWEST_VALUES: Final = 5
_BETWEEN_WORDS: Final = re.compile(r"[\s_()\[\]{},;:|]+")


@dataclass(frozen=True, slots=True, kw_only=True)
class Missing:
    """A quantity that has to be told, with its column and its unit as far as they are known."""

    quantity: TestQuantity
    column: str = ""
    unit: str = ""


NO_COLUMN: Final = "COLUMN"
"""Stands for the heading of a column that is not known."""


def column_option(key: str, column: str, unit: str) -> str:
    """A --column option as a shell takes it."""
    return f"--column {shlex.quote(f'{key}={column}:{unit}')}"


def suggested_options(
    missing: Sequence[Missing], free: Sequence[str], units: Mapping[str, str], read: ReadColumn
) -> str:
    """Options for all that is missing, with the likeliest of the `free` columns, or `NO_COLUMN`."""
    left = [name for name in free if name not in {entry.column for entry in missing}]
    numbers = {name: samples for name in free if (samples := read(name)) is not None}
    options: list[str] = []
    is_sure = True
    suggested: set[str] = set()
    for entry in missing:
        if entry.column and entry.column in suggested:
            # A command may be a current or a voltage.
            continue
        column = entry.column or _likely_column(entry.quantity, left, units, numbers)
        if not column:
            options.append(f"--column {entry.quantity}={NO_COLUMN}:{next(iter(FACTORS[entry.quantity]))}")
            continue
        suggested.add(column)
        left = [name for name in left if name != column]
        stated = units.get(column, "")
        unit = entry.unit or (stated if quantity_of(stated) == entry.quantity else "")
        is_sure = is_sure and bool(entry.column and unit)
        unit = unit or likely_unit(entry.quantity, column, numbers.get(column))
        options.append(column_option(entry.quantity, column, unit))
    listed = " ".join(options)
    return f"{'with' if NO_COLUMN in listed else 'as in' if is_sure else 'likely'} {listed}"


def likely_unit(quantity: TestQuantity, name: str, samples: Floats | None) -> str:
    """The unit that a word of the heading is, or is much like, or else one for numbers of the size of a test."""
    words = _BETWEEN_WORDS.split(name)
    for word in words:
        if len(word) > 1 and quantity_of(word) == quantity:
            return word
    for word in words:
        near = closest(word, [*FACTORS[quantity]])
        letters = iter(word)
        # A unit that is written longer, as tonf and kmh: kph is no mph, and mN no MN.
        if (
            len(near) > 1
            and word[0] == near[0]
            and all(letter in letters for letter in near if letter.isalpha())
        ):
            return near
    size = None if samples is None else _size(quantity, samples)
    if size is None:
        return next(iter(FACTORS[quantity]))
    return next(unit for unit, limit in TEST_ROLES[quantity].units if size <= limit)


def _size(quantity: TestQuantity, samples: Floats) -> float | None:
    values = samples[np.isfinite(samples)]
    if values.size < 2:
        return None
    if quantity == "time":
        return float(np.median(np.abs(np.diff(values))))
    if quantity in ("current", "voltage"):
        return float(np.abs(values).max())
    return 0.5 * float(np.ptp(values))


def _likely_column(
    quantity: TestQuantity, left: Sequence[str], units: Mapping[str, str], numbers: Mapping[str, Floats]
) -> str:
    """A column of its unit, or else without any unit: for the time one that increases, otherwise one that varies."""
    left = [name for name in left if not is_of_another(name, quantity)]
    of_unit = [name for name in left if quantity_of(units.get(name, "")) == quantity]
    # A unit that is none of the quantity, known or not, contradicts it.
    without = [name for name in left if name in numbers and not units.get(name, "")]
    increasing = [name for name in without if np.all(np.diff(numbers[name]) > 0.0)]
    if quantity == "time":
        # A number of the sample increases, too.
        candidates = sorted(increasing, key=lambda name: bool(np.all(np.diff(numbers[name]) == 1.0)))
    else:
        varying = [name for name in without if np.unique(numbers[name]).size >= _FEWEST_VALUES]
        candidates = [name for name in varying if name not in increasing]
    return next(iter([*of_unit, *candidates]), "")


class ColumnTable(ABC):
    """Columns of a file: their names, their values on request, and the location of a row in the file.

    `names` are in file order, `units` are stated by the file apart from the names, `sha256` is the hash of the
    bytes of the file. `stamps` are columns of times of the day, which are read as seconds since the first. `unused` are
    parts of the file that are no column: sheets, variables without a vector of numbers; `further` are those that have a
    record of their own. `encoding` names the encoding of a text which is not UTF-8. `arrays` are columns by
    the matrix that has them, `headings` are the names as a text has them, where several are equal. `joined` says how
    several files are one table, and `is_sure` whether their times are known to be of one clock.
    """

    names: tuple[str, ...]
    units: Mapping[str, str]
    sha256: str
    stamps: frozenset[str] = frozenset()
    unused: tuple[str, ...] = ()
    further: tuple[str, ...] = ()
    encoding: str = ""
    arrays: Mapping[str, tuple[str, ...]] = MappingProxyType({})
    headings: tuple[str, ...] = ()
    joined: str = ""
    is_sure: bool = True

    def without_markers(self) -> tuple[ColumnTable, Sequence[str]]:
        """The table without lines of a text that stand among its rows and are none, and these with their numbers."""
        return self, ()

    @abstractmethod
    def read(self, wanted: Sequence[str]) -> dict[str, Floats]:
        """Columns by name, each of shape (n_time,); an empty cell is NaN.

        A constant may have shape (1,) if the format stores scalars.
        """

    def numbers(self, name: str) -> Floats | None:
        """A column by its name; `None` where it does not have numbers."""
        try:
            return self.read([name])[name]
        except RecordError:
            return None

    def texts(self, name: str) -> list[str]:
        """A column as texts."""
        return [f"{value:g}" for value in self.read([name])[name]]

    def instant(self, name: str) -> float:
        """The first time of a column of `stamps` [s], since midnight or the year 1."""
        raise NotImplementedError(name)

    @abstractmethod
    def size_of(self, name: str) -> int:
        """Number of values of a column."""

    @abstractmethod
    def locate(self, row: int) -> str:
        """Location of row `row` of the columns (from 0) in the file, for messages."""


@dataclass(kw_only=True, eq=False, repr=False)
class VectorTable(ColumnTable):
    """Columns that the format stores as arrays (MATLAB, TDMS)."""

    source: str
    sha256: str
    vectors: Mapping[str, NDArray[np.generic]]
    units: Mapping[str, str] = field(default_factory=dict)
    unused: tuple[str, ...] = ()
    arrays: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.names = tuple(self.vectors)

    def read(self, wanted: Sequence[str]) -> dict[str, Floats]:
        """Convert the requested vectors, each of shape (n_time,) or (1,)."""
        lengths = {name: self.vectors[name].size for name in wanted if self.vectors[name].size != 1}
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"'{name}' has {size}" for name, size in lengths.items())
            raise RecordError(
                f"{self.source}: columns must be equally long, but {listed}; save them from one test"
            )
        # What is beyond the range of doubles is infinite, and refused with its row.
        with np.errstate(over="ignore", invalid="ignore"):
            return {name: self.vectors[name].astype(np.float64, copy=False) for name in wanted}

    def size_of(self, name: str) -> int:
        """Number of values of a vector."""
        return self.vectors[name].size

    def locate(self, row: int) -> str:
        """Place of a row, which is counted from 0, such as "row 1" for the first."""
        return f"row {row + 1}"


def unused_parts(noun: str, names: Sequence[str], why: str) -> tuple[str, ...]:
    """Parts of a file that are no columns, and why, as `ColumnTable.unused` has them; nothing where there are none."""
    return (f"{noun}{'s' if len(names) > 1 else ''} {list_names(names)} ({why})",) if names else ()
