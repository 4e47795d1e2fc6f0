"""FMUs that are unpacked, and instances of their binaries by either standard, called as an importer calls them."""

import ctypes
import zipfile
from collections.abc import Mapping, Sequence
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

LOGGERS = {
    "2": ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p),
    "3": ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p),
}


class Callbacks(ctypes.Structure):
    """What an importer gives to an instance of FMI 2.0."""

    _fields_ = (
        ("logger", LOGGERS["2"]),
        ("allocate", c_void_p),
        ("free", c_void_p),
        ("finished", c_void_p),
        ("environment", c_void_p),
    )


class Unpacked:
    """An FMU in a folder: its description, references by name, and its binary."""

    def __init__(self, fmu: bytes, folder: Path) -> None:
        with zipfile.ZipFile(BytesIO(fmu)) as archive:
            archive.extractall(folder)
        self.folder = folder
        self.root = ElementTree.parse(folder / "modelDescription.xml").getroot()
        self.version = self.root.attrib["fmiVersion"][0]
        self.token = self.root.get("guid") or self.root.attrib["instantiationToken"]
        variables = self.root.find("ModelVariables")
        assert variables is not None
        self.references = {each.attrib["name"]: int(each.attrib["valueReference"]) for each in variables}

    @property
    def library(self) -> ctypes.CDLL:
        """The binary, loaded."""
        (place,) = self.folder.glob("binaries/*/*")
        return ctypes.CDLL(str(place))


class Instance:
    """An instance, initialised with inputs; `said` are the sentences that it logs, `instance` is `None` if refused."""

    def __init__(
        self, unpacked: Unpacked, *, token: str | None = None, model_exchange: bool = False, **start: float
    ) -> None:
        self.unpacked, self.library = unpacked, unpacked.library
        self.prefix, self.said = f"fmi{unpacked.version}", []
        self.logger = LOGGERS[unpacked.version](lambda *args: self.said.append(args[-1].decode()))
        about = (b"one", (token or unpacked.token).encode(), b"")
        self.instance: c_void_p | None = None
        if self.prefix == "fmi2":
            self.callbacks = Callbacks(logger=self.logger)
            made = self._function("Instantiate", c_void_p)(
                about[0], 0 if model_exchange else 1, *about[1:], byref(self.callbacks), 0, 0
            )
        else:
            flags = [c_bool(False)] * 4
            made = self._function("InstantiateCoSimulation", c_void_p)(
                *about, *flags, None, c_size_t(0), None, self.logger, None
            )
        if made is None:
            return
        self.instance = c_void_p(made)
        self.initialise(**start)

    def initialise(self, **start: float) -> None:
        """From the instantiated state to the first step, of which what was read before is true."""
        if self.prefix == "fmi2":
            assert self.call("SetupExperiment", 0, c_double(0.0), c_double(0.0), 0, c_double(0.0)) == 0
            assert self.call("EnterInitializationMode") == 0
        else:
            zero = (c_bool(False), c_double(0.0))
            assert self.call("EnterInitializationMode", *zero, c_double(0.0), *zero) == 0
        if start:
            assert self.set(start) == 0
        names = list(self.unpacked.references)
        before = self.get(*names)
        assert self.call("ExitInitializationMode") == 0
        assert before.tolist() == self.get(*names).tolist()

    def _function(self, name: str, kind: Any = c_int) -> Any:
        function = self.library[f"{self.prefix}{name}"]
        function.restype = kind
        return function

    def call(self, name: str, *args: Any) -> int:
        """Status of a function of the standard."""
        status: int = self._function(name)(self.instance, *args)
        return status

    def _numbers(self, names: Sequence[str | int], values: Any) -> tuple[Any, ...]:
        n = len(names)
        numbers = [name if isinstance(name, int) else self.unpacked.references[name] for name in names]
        more = (c_size_t(n),) if self.prefix == "fmi3" else ()
        return (c_uint * n)(*numbers), c_size_t(n), values, *more

    def set(self, values: Mapping[Any, float]) -> int:
        """Set variables by name, or by reference."""
        kind = "SetReal" if self.prefix == "fmi2" else "SetFloat64"
        return self.call(kind, *self._numbers(list(values), (c_double * len(values))(*values.values())))

    def get(self, *names: str) -> np.ndarray:
        """Values (n_names,) of variables."""
        values = (c_double * len(names))()
        kind = "GetReal" if self.prefix == "fmi2" else "GetFloat64"
        assert self.call(kind, *self._numbers(names, values)) == 0
        return np.array(values)

    def step(self, time: float, step: float) -> int:
        """A step of co-simulation."""
        times = c_double(time), c_double(step)
        if self.prefix == "fmi2":
            return self.call("DoStep", *times, 1)
        flags, last = [c_bool() for _ in range(3)], c_double()
        status = self.call("DoStep", *times, c_bool(True), *map(byref, flags), byref(last))
        assert last.value == (time + step if status == 0 else time)
        return status
