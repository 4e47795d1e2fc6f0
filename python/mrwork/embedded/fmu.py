"""A damper or a controller as a functional mock-up unit: its C in a frame of FMI 2.0 or 3.0, with or without a binary.

The frames declare the types of the standards themselves, so that an FMU needs no header of others. Standards:
Functional Mock-up Interface 2.0.4 and 3.0.1 (Modelica Association).
"""

from __future__ import annotations

import hashlib
import html
import os
import platform
import shutil
import subprocess
import uuid
import zipfile
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, Literal, NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from mrwork import __version__
from mrwork.base.units import unit_of
from mrwork.embedded.c_source import CSource, Signal, status_bit
from mrwork.errors import LibraryError, escape_text

FMIVersion = Literal["2.0", "3.0"]


class _Binary(NamedTuple):
    """Where an importer looks for the binary of a platform: its folder in either version, and the end of its name."""

    folders: Mapping[FMIVersion, str]
    suffix: str


_BINARIES: Final[Mapping[tuple[str, str], _Binary]] = {
    ("Linux", "x86_64"): _Binary({"2.0": "linux64", "3.0": "x86_64-linux"}, ".so"),
    ("Linux", "aarch64"): _Binary({"2.0": "aarch64-linux", "3.0": "aarch64-linux"}, ".so"),
    ("Darwin", "x86_64"): _Binary({"2.0": "darwin64", "3.0": "x86_64-darwin"}, ".dylib"),
    ("Darwin", "arm64"): _Binary({"2.0": "darwin64", "3.0": "aarch64-darwin"}, ".dylib"),
}
# A contracted multiplication and addition would have other bits than the product.
_FLAGS: Final = ("-std=c99", "-O2", "-ffp-contract=off")
# Functions of a shared library have the names of the standard, without the prefix of static ones.
_SHARED: Final = ("-DFMI2_OVERRIDE_FUNCTION_PREFIX", "-DFMI3_OVERRIDE_FUNCTION_PREFIX")
# The word of status, an output of every FMU.
_STATUS: Final = Signal(
    name="status", unit="", description="Bits of the last step, see NAME_status of the header"
)
# The base units of the standard have no volt; a cycle is a number there.
_DERIVED: Final[Mapping[str, Mapping[str, int]]] = {
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "cycle": {},
}
# A sentence for whoever couples the FMU; {grid} is the time of which a step is a multiple.
_USE: Final[Mapping[str, str]] = {
    "damper": (
        "A positive force resists a positive velocity. In co-simulation a step is a whole number of sub-steps of "
        "{grid} s: the damper moves straight from the displacement at the velocity that were set before the step, and "
        "its force afterwards is that at the end of this motion. In model exchange (FMI 2.0) set the inputs "
        "at every evaluation: an importer that holds them between its outputs integrates another motion."
    ),
    "controller": (
        "A step is a whole number of sample times of {grid} s. The readings that were set before the step are sampled "
        "at its start; its commands are held until the next sample. Commands that are read after readings were set, "
        "before the step, are those that this step will send: a plant that takes them has no delay of a sample."
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Variable:
    """A variable of the description, and its place in the `model` of the frame."""

    signal: Signal
    place: str
    causality: Literal["input", "parameter", "output", "local"] = "local"
    variability: Literal["continuous", "discrete", "tunable"] = "continuous"
    derivative_of: int | None = None

    @property
    def start(self) -> float | None:
        """What an importer may set; `None` for what is computed."""
        return float(self.signal.value or 0.0) if self.causality in ("input", "parameter") else None


def c_compiler() -> str | None:
    """The C compiler of this machine: `cc`, `gcc` or `clang`; `None` without one, or where FMUs have no binary."""
    if (platform.system(), platform.machine()) not in _BINARIES:
        return None
    return next((found for name in ("cc", "gcc", "clang") if (found := shutil.which(name))), None)


def fmu_of(source: CSource, version: FMIVersion, compiler: str | None = None) -> bytes:
    """The FMU of a damper or a controller; equal arguments give equal bytes, and another token for another content.

    A damper of FMI 2.0 is for model exchange and co-simulation, all else for co-simulation.

    Parameters
    ----------
    source
        C99 and its variables.
    version
        Version of the standard.
    compiler
        What compiles a binary for this machine, as `c_compiler` finds it; without it the FMU has sources alone, which
        the importer compiles.

    Raises
    ------
    LibraryError
        If the compiler refuses the sources.
    """
    token = uuid.UUID(bytes=_digest(_texts(source, version, ""))[:16])
    contents = {name: text.encode() for name, text in _texts(source, version, f"{{{token}}}").items()}
    if compiler is not None:
        binary = _BINARIES[platform.system(), platform.machine()]
        place = f"binaries/{binary.folders[version]}/{source.name}{binary.suffix}"
        contents[place] = _shared_library(contents, _compiled_files(source), compiler)
    archive = BytesIO()
    with zipfile.ZipFile(archive, "w") as fmu:
        for name, content in contents.items():
            entry = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = 0o644 << 16
            fmu.writestr(entry, content)
    return archive.getvalue()


def _digest(texts: Mapping[str, str]) -> bytes:
    digest = hashlib.sha256()
    for name, text in texts.items():
        for part in (name, text):
            digest.update(hashlib.sha256(part.encode()).digest())
    return digest.digest()


def _texts(source: CSource, version: FMIVersion, token: str) -> dict[str, str]:
    """The files of the FMU but its binary, by their path in it."""
    variables = _variables(source, version)
    texts = {
        "modelDescription.xml": _text_of(_description(source, version, token, variables)),
        **{f"sources/{name}": source.files[name] for name in (f"{source.name}.h", f"{source.name}.c")},
        f"sources/{source.name}_fmu.c": _frame(source, version, token, variables),
        "documentation/index.html": _page(source, variables),
        "documentation/licenses/license.txt": _resource("licence.txt"),
    }
    if version == "3.0":
        texts["sources/buildDescription.xml"] = _text_of(_build_description(source))
    return texts


def _resource(name: str) -> str:
    return (files("mrwork.embedded") / "frames" / "fmu" / name).read_text(encoding="utf-8")


def _text_of(root: Element) -> str:
    # No document of XML has a control character, not even escaped.
    for element in root.iter():
        for name, value in element.attrib.items():
            element.set(name, escape_text(value))
    indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, encoding="unicode")}\n'


def _compiled_files(source: CSource) -> list[str]:
    return [f"{source.name}.c", f"{source.name}_fmu.c"]


def _shared_library(contents: Mapping[str, bytes], names: Sequence[str], compiler: str) -> bytes:
    """What the compiler makes of the sources; functions that are not of the standard stay hidden."""
    with TemporaryDirectory() as place:
        for name, content in contents.items():
            if name.startswith("sources/"):
                (Path(place) / Path(name).name).write_bytes(content)
        command = [
            compiler,
            *_FLAGS,
            *_SHARED,
            "-fPIC",
            "-shared",
            "-fvisibility=hidden",
            *names,
            "-lm",
            "-o",
            "library",
        ]
        english = {**os.environ, "LC_ALL": "C"}
        made = subprocess.run(
            command, cwd=place, env=english, capture_output=True, text=True, errors="replace", check=False
        )
        if made.returncode != 0:
            said = made.stderr.splitlines() or [f"it ended with {made.returncode}"]
            mistake = next((line for line in said if "error" in line), said[0])
            raise LibraryError(
                f"{escape_text(compiler)} does not compile the sources of the FMU: {escape_text(mistake)}; "
                "repair the compiler, or write the FMU without a binary"
            )
        return (Path(place) / "library").read_bytes()


def _has_model_exchange(source: CSource, version: FMIVersion) -> bool:
    return source.kind == "damper" and version == "2.0"


def _grid(source: CSource) -> float:
    """The time of which a step of co-simulation is a multiple, [s]."""
    return float(source.sample_time / source.substeps if source.kind == "damper" else source.sample_time)


def _variables(source: CSource, version: FMIVersion) -> list[_Variable]:
    """Inputs, parameters, outputs, states, rates; the value reference is the number from 1, and 0 that of the time."""
    states = [
        _Variable(
            signal=Signal(name=f"state[{n}]", unit="", description="State of the damper"),
            place=f"memory.state[{n}]",
        )
        for n in range(source.n_states)
    ]
    if source.is_lagged:
        unit = next(entry.unit for entry in source.inputs if entry.name == "command")
        current = Signal(name="current", unit=unit, description="Command behind the lag of the driver")
        states.append(_Variable(signal=current, place="memory.current"))
    # A gain may have the name of what it makes: that of a constant command is the command.
    taken = {entry.name for entry in (*source.inputs, *source.outputs)}
    parameters = [
        _Variable(
            signal=replace(entry, name=f"parameters.{entry.name}") if entry.name in taken else entry,
            place=f"parameters.{entry.name}",
            causality="parameter",
            variability="tunable",
        )
        for entry in source.parameters
    ]
    others = [
        *(_Variable(signal=entry, place=f"input.{entry.name}", causality="input") for entry in source.inputs),
        *parameters,
        *(
            _Variable(
                signal=entry,
                place=f"output[{n}]",
                causality="output",
                variability="continuous" if source.kind == "damper" else "discrete",
            )
            for n, entry in enumerate(source.outputs)
        ),
        _Variable(
            signal=replace(_STATUS, description=_STATUS.description.replace("NAME", source.name)),
            place=f"output[{len(source.outputs)}]",
            causality="output",
            variability="discrete",
        ),
    ]
    rates = [
        _Variable(
            signal=Signal(
                name=f"der({state.signal.name})",
                unit=f"{state.signal.unit}/s" if state.signal.unit else "",
                description=f"Rate of {state.signal.name}",
            ),
            place=f"rate[{n}]",
            derivative_of=len(others) + n + 1,
        )
        for n, state in enumerate(states)
    ]
    return [*others, *states, *(rates if _has_model_exchange(source, version) else [])]


def _frame(source: CSource, version: FMIVersion, token: str, variables: Sequence[_Variable]) -> str:
    """The C of the frame: what it must know of the source, then the text of the package for this kind and version."""
    n_settable = len(source.inputs) + len(source.parameters)
    n_rates = source.n_states + source.is_lagged
    # Outputs, and the word of status.
    n_outputs = len(source.outputs) + 1
    first_state = n_settable + n_outputs + 1
    time = ["    V(0, time, 0.0)"]
    rows = [
        f"    V({number}, {entry.place}, {entry.start or 0.0!r})"
        for number, entry in enumerate(variables, start=1)
    ]
    constants = {
        "TOKEN": f'"{token}"',
        "HAS_MODEL_EXCHANGE": int(_has_model_exchange(source, version)),
        "GRID": repr(_grid(source)),
        "IS_LAGGED": int(source.is_lagged),
        "N_INPUTS": len(source.inputs),
        "N_SETTABLE": n_settable,
        "N_OUTPUTS": n_outputs,
        "MODEL_PREFIX": f"{source.name}_",
        "STATUS_COMMAND_LIMITED": status_bit("command_limited"),
        "STATUS_OUTSIDE_TESTED": status_bit("outside_tested"),
        "N_RATES": n_rates,
        "FIRST_STATE": first_state,
        "FIRST_RATE": first_state + n_rates,
    }
    parts = [
        _resource("head.c").replace("NAME", source.name),
        "".join(f"#define {name} {value}\n" for name, value in constants.items()),
        "/* Value reference, place in the model, start value. */\n"
        f"#define SETTABLE(V) \\\n{_continued(rows[:n_settable])}\n"
        f"#define CALCULATED(V) \\\n{_continued(time + rows[n_settable:])}\n",
        _resource(f"{source.kind}.c").replace("NAME", source.name),
        _resource("model.c"),
        _resource(f"fmi{version[0]}.c"),
    ]
    title = f"{source.name} as a functional mock-up unit of FMI {version}; written by mrwork {__version__}."
    return "\n".join([f"/* {title} */", *parts])


def _continued(rows: Sequence[str]) -> str:
    return " \\\n".join(rows)


def _description(source: CSource, version: FMIVersion, token: str, variables: Sequence[_Variable]) -> Element:
    """`modelDescription.xml`."""
    is_2 = version == "2.0"
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": version,
            "modelName": source.name,
            "guid" if is_2 else "instantiationToken": token,
            "description": source.description,
            "license": "MIT, see documentation/licenses",
            "generationTool": f"mrwork {__version__}",
            "variableNamingConvention": "structured",
        },
    )
    _add_interfaces(root, source, version)
    _add_units(root, variables)
    SubElement(SubElement(root, "LogCategories"), "Category", {"name": "logStatusError"})
    SubElement(root, "DefaultExperiment", {"startTime": "0.0", "stepSize": repr(float(source.sample_time))})
    listed = SubElement(root, "ModelVariables")
    if not is_2:
        about = {
            "name": "time",
            "valueReference": "0",
            "causality": "independent",
            "variability": "continuous",
        }
        SubElement(listed, "Float64", {**about, "description": "Time", "unit": "s"})
    for number, entry in enumerate(variables, start=1):
        about = {
            "name": entry.signal.name,
            "valueReference": str(number),
            "description": entry.signal.description,
            "causality": entry.causality,
            "variability": entry.variability,
        }
        value = {"unit": entry.signal.unit} if entry.signal.unit else {}
        if entry.start is not None:
            value["start"] = repr(entry.start)
        if entry.derivative_of is not None:
            value["derivative"] = str(entry.derivative_of)
        if is_2:
            SubElement(SubElement(listed, "ScalarVariable", about), "Real", value)
        else:
            SubElement(listed, "Float64", about | value)
    _add_structure(root, source, version, variables)
    return root


def _add_interfaces(root: Element, source: CSource, version: FMIVersion) -> None:
    """What the FMU can do, and in FMI 2.0 the files that are to be compiled."""
    if version == "3.0":
        can = ("canGetAndSetFMUState", "canSerializeFMUState", "canHandleVariableCommunicationStepSize")
        about = {"modelIdentifier": source.name, **dict.fromkeys(can, "true")}
        SubElement(root, "CoSimulation", {**about, "fixedInternalStepSize": repr(_grid(source))})
        return
    can = ("canNotUseMemoryManagementFunctions", "canGetAndSetFMUstate", "canSerializeFMUstate")
    about = {"modelIdentifier": source.name, **dict.fromkeys(can, "true")}
    varying = {"canHandleVariableCommunicationStepSize": "true"}
    interfaces = [SubElement(root, "CoSimulation", about | varying)]
    if _has_model_exchange(source, version):
        root.insert(0, Element("ModelExchange", {**about, "completedIntegratorStepNotNeeded": "true"}))
        interfaces.append(root[0])
    for interface in interfaces:
        compiled = SubElement(interface, "SourceFiles")
        for name in _compiled_files(source):
            SubElement(compiled, "File", {"name": name})


def _add_units(root: Element, variables: Sequence[_Variable]) -> None:
    """Each unit with its powers of the base units of the standard; one that has none, as m^-n, by its name alone."""
    definitions = SubElement(root, "UnitDefinitions")
    for name in dict.fromkeys(["s", *(entry.signal.unit for entry in variables if entry.signal.unit)]):
        definition = SubElement(definitions, "Unit", {"name": name})
        # As in N s/(m A), whose parentheses say what the one slash says.
        if (unit := unit_of(name.replace("(", "").replace(")", ""))) is None:
            continue
        powers = Counter[str]()
        for base, power in unit.powers.items():
            powers.update({part: power * each for part, each in _DERIVED.get(base, {base: 1}).items()})
        shown = {base: str(power) for base, power in powers.items() if power}
        factor = {} if unit.factor == 1.0 else {"factor": repr(unit.factor)}
        SubElement(definition, "BaseUnit", shown | factor)


def _add_structure(
    root: Element, source: CSource, version: FMIVersion, variables: Sequence[_Variable]
) -> None:
    """Outputs, rates, and what the initialisation computes.

    An output depends on the inputs and states, but not on a command that a driver lags, so that a loop through the
    command is not algebraic. All else may depend on all that is known.
    """
    numbered = list(enumerate(variables, start=1))
    outputs = [number for number, entry in numbered if entry.causality == "output"]
    rates = [number for number, entry in numbered if entry.derivative_of is not None]
    states = [entry.derivative_of for _, entry in numbered if entry.derivative_of is not None]
    inputs = [
        number
        for number, entry in numbered
        if entry.causality == "input" and not (source.is_lagged and entry.signal.name == "command")
    ]
    known = {"dependencies": " ".join(map(str, [*inputs, *states]))}
    groups: list[tuple[str, str, list[int], dict[str, str]]] = [
        ("Outputs", "Output", outputs, known),
        ("Derivatives", "ContinuousStateDerivative", rates, {}),
        ("InitialUnknowns", "InitialUnknown", sorted([*outputs, *states, *rates]), {}),
    ]
    structure = SubElement(root, "ModelStructure")
    for group, unknown, numbers, about in groups:
        if version == "3.0":
            for number in numbers:
                SubElement(structure, unknown, {"valueReference": str(number), **about})
        elif numbers:
            listed = SubElement(structure, group)
            for number in numbers:
                SubElement(listed, "Unknown", {"index": str(number), **about})


def _build_description(source: CSource) -> Element:
    """`sources/buildDescription.xml` of FMI 3.0."""
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = SubElement(root, "BuildConfiguration", {"modelIdentifier": source.name})
    compiled = SubElement(configuration, "SourceFileSet", {"language": "C99"})
    for name in _compiled_files(source):
        SubElement(compiled, "SourceFile", {"name": name})
    return root


def _page(source: CSource, variables: Sequence[_Variable]) -> str:
    """`documentation/index.html`."""
    use = _USE[source.kind].format(grid=f"{_grid(source):g}")
    rows = "\n".join(
        f"<tr><td>{html.escape(entry.signal.name)}</td><td>{entry.causality}</td>"
        f"<td>{html.escape(entry.signal.unit)}</td><td>{_escaped(entry.signal.description)}</td></tr>"
        for entry in variables
    )
    compiled = " ".join(("cc", *_FLAGS, *_SHARED, *(f"sources/{name}" for name in _compiled_files(source))))
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{source.name}</title></head><body>\n'
        f"<h1>{source.name}</h1>\n<p>{_escaped(source.description)}</p>\n<p>{html.escape(use)}</p>\n"
        f"<table>\n<tr><th>variable</th><th>causality</th><th>unit</th><th>meaning</th></tr>\n{rows}\n</table>\n"
        f"<p>The sources need a compiler of C99 and its mathematical library: <code>{compiled} -lm</code>. "
        "Where a compiler contracts multiplications and additions, last digits differ.</p>\n</body></html>\n"
    )


def _escaped(text: str) -> str:
    """A text of a user within the page."""
    return html.escape(escape_text(text))
