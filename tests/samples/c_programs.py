"""Programs of printed C, compiled; without a compiler the test is skipped by its name."""

import ctypes
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest

STRICT = ("-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-pedantic")


def compiled(folder: Path, files: Mapping[str, str], *options: str, compiler: str = "gcc") -> Path:
    """The program, or with `-shared` the library, of the texts of some files."""
    if shutil.which(compiler) is None:
        pytest.skip(f"there is no {compiler} to compile printed C")
    for name, text in files.items():
        (folder / name).write_text(text)
    sources = [name for name in files if name.endswith(".c")]
    command = [compiler, *STRICT, *options, *sources, "-lm", "-o", "program"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    return folder / "program"


def output_of(program: Path, *before: str) -> str:
    """What a program prints that ends with 0."""
    done = subprocess.run([*before, str(program)], capture_output=True, text=True, check=False)
    assert not done.returncode, done.stdout + done.stderr
    return done.stdout


def library(folder: Path, files: Mapping[str, str], *options: str) -> ctypes.CDLL:
    """The functions of printed C."""
    return ctypes.CDLL(str(compiled(folder, files, "-shared", "-fPIC", *options)))
