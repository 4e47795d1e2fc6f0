"""Damaged copies of files: what reads one gives a result or an error of ours, and no file is lost."""

import json
import re
import warnings
from collections.abc import Callable
from contextlib import chdir
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import motion_files
import numpy as np
import pytest
import rig_files
import tuning_samples
from command_line import mrwork
from examples import examples
from hypothesis import assume, given
from hypothesis import strategies as st
from record_files import clean_columns
from run_folders import add_every_file
from scipy.io import savemat
from verb_folders import written_record

import mrwork as mr
from mrwork.identification.fit_file import reopen
from mrwork.motions.forces import read_forces

TOKENS = st.sampled_from(
    [
        *("", " ", "\t", "\r", "\0", "\x1b[31m", "\u202e", "\ufeff", "x", "true", "[]", "{}", '"', "=", ","),
        *("nan", "-inf", "1e999", "1e308", "5e-324", "2147483648", "-1", "0", "1,5", '"1 kg"', "9" * 400),
        *("[" * 3000, "[nan]", "../x"),
    ]
)
VALUES = st.sampled_from(
    [None, "", "\x1b[31m\n", -1, 0, 1.5, 1e300, float("nan"), 10**80, True, [], {}, {"a": [None]}]
)


@st.composite
def texts(draw: st.DrawFn, text: str) -> bytes:
    """A text with words, lines or characters lost, doubled, swapped or replaced, most of them in its head."""
    for _ in range(draw(st.integers(1, 3))):
        lines = text.split("\n")
        numbers = st.integers(0, min(len(lines), 20) - 1) | st.integers(0, len(lines) - 1)
        here, there = draw(numbers), draw(numbers)
        words = list(re.finditer(r"[\w.+-]+", lines[here]))
        match draw(st.sampled_from(["word", "word", "word", "gone", "twice", "swapped", "inserted", "cut"])):
            case "word" if words:
                found = words[draw(st.integers(0, len(words) - 1))]
                lines[here] = lines[here][: found.start()] + draw(TOKENS) + lines[here][found.end() :]
            case "gone":
                del lines[min(here, there) : max(here, there) + 1]
            case "twice":
                lines[here:here] = [lines[there]] * draw(st.sampled_from([1, 300]))
            case "swapped":
                lines[here], lines[there] = lines[there], lines[here]
            case "cut":
                lines = [*lines[:here], lines[here][: draw(st.integers(0, 40))]]
            case _:
                place = draw(st.integers(0, len(lines[here])))
                lines[here] = lines[here][:place] + draw(TOKENS) + lines[here][place:]
        text = "\n".join(lines) or "\n"
    return text.encode(draw(st.sampled_from([*5 * ["utf-8"], "utf-16", "latin-1"])), "replace")


@st.composite
def blobs(draw: st.DrawFn, path: Path) -> bytes:
    """Bytes of a file of which some are lost, changed or inserted, most of them near the start or the end."""
    content = path.read_bytes()
    places = st.integers(0, min(len(content), 400)) | st.integers(0, len(content))
    place = draw(places | places.map(lambda place: len(content) - place))
    lost = draw(st.sampled_from([0, 1, 4, 8, len(content)]))
    inserted = draw(st.binary(max_size=8) | st.sampled_from([b"\xff" * 8, b"\0" * 8]))
    return content[:place] + inserted + content[place + lost :]


def places(tree: Any) -> list[tuple[Any, Any]]:
    """Every container in a JSON value with each of its keys."""
    keys = list(tree) if isinstance(tree, dict) else range(len(tree)) if isinstance(tree, list) else ()
    return [place for key in keys for place in ((tree, key), *places(tree[key]))]


@st.composite
def documents(draw: st.DrawFn, path: Path) -> bytes:
    """A JSON document with a value replaced, removed, renamed or moved."""
    content = path.read_bytes()
    document = json.loads(content)
    listed = places(document)
    container, key = listed[draw(st.integers(0, len(listed) - 1))]
    match draw(st.sampled_from(["is", "is", "is", "removed", "renamed", "moved"])):
        case "removed":
            del container[key]
        case "renamed" if isinstance(container, dict):
            container[f"{key}_"] = container.pop(key)
        case "moved":
            other, there = listed[draw(st.integers(0, len(listed) - 1))]
            container[key] = json.loads(json.dumps(other[there]))
        case _:
            container[key] = draw(VALUES)
    assume(json.dumps(document) != json.dumps(json.loads(content)))
    return json.dumps(document).encode()


def is_read(read: Callable[[], object]) -> bool:
    """Whether a file is read; it is refused by an error of ours, in printable lines."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mr.errors.MrworkWarning)
        try:
            repr(read())
        except mr.MrworkError as error:
            refused = str(error)
        else:
            return True
    assert refused.replace("\n", "").isprintable()
    return False


GAL = 100.0 * motion_files.accelerations()[:60]
TABLE = """file,use,time,displacement,force,velocity,command,doubt
rig.csv,fit,,,,,0.5 A,
"a, b.csv",test,t_s:s,displacement_m:m,force_n:N,velocity_mps:m/s,i:A,the force"""
BUILDING = """masses = [2.0, 1.0]
stiffnesses = [3.0, 2.0]
rayleigh = { ratios = [0.02, 0.02], modes = [1, 2] }
viscous = [{ storey = 1, damping = 0.4 }]
brace = [{ storey = 2, stiffness = 9.0, mass = 0.01, damping = 0.1 }]
tuned_mass = [{ floor = 2, mass_ratio = 0.02, tuning = "den_hartog" }]
friction = [{ storey = "storey 2", slip_load = 0.1, stiffness = 5.0, sharpness = 20.0, name = "brace that slips" }]"""
TUNED = tuning_samples.STUDY.format(building=tuning_samples.TWO_STOREYS) + tuning_samples.motion("A", 1)


def record(delimiter: str, point: str = ".") -> str:
    columns = clean_columns()
    rows = np.stack(list(columns.values()), axis=1)[:60]
    lines = [delimiter.join(f"{cell:.6f}" for cell in row).replace(".", point) for row in rows]
    return "\n".join([delimiter.join(columns), *lines])


FORCES = "time (s),roof (kN),deck\n" + "".join(f"{0.01 * n:.2f},{n % 7},{n % 5}\n" for n in range(40))

ROAD = "distance_m,height_mm\n" + "".join(f"{0.1 * row:.1f},{height:.3f}\n" for row, height in enumerate(GAL))
FILES: dict[str, tuple[str, Callable[[Path], object]]] = {
    "rig.csv": (record(","), mr.read_damper_test),
    "10mm2Hz0x5A.dat": (record(";", ","), mr.read_damper_test),
    "rig.txt": ("# a comment\n" + record(" "), mr.read_damper_test),
    "rig.lvm": ("\n".join(rig_files.lvm("Multi").split("\n")[:90]), mr.read_damper_test),
    "tests.csv": (TABLE, mr.records.read_test_table),
    "a.AT2": ("\n".join(motion_files.at2_lines(GAL / 980.665, "NPTS=  60, DT= .01000 SEC")), mr.read_motion),
    "a.NS": ("\n".join(motion_files.knet_lines(np.round(100 * GAL).astype(int), "0.6")), mr.read_motion),
    "a.v2": ("\n".join(motion_files.cosmos_lines(GAL)), mr.read_motion),
    "b.v2": ("\n".join(motion_files.csmip_lines(GAL)), mr.read_motion),
    "a.ASC": ("\n".join(motion_files.esm_lines(GAL)), mr.read_motion),
    "a.smc": ("\n".join(motion_files.smc_lines(GAL)), mr.read_motion),
    "a.V2A": ("\n".join(motion_files.geonet_lines(GAL, "Corrected")), mr.read_motion),
    "wind.csv": (FORCES, partial(read_forces, floors=("deck", "roof"), shares=None, unit="N", dt=None)),
    "road.csv": (ROAD, lambda path: mr.motions.read_road(path, speed=20.0)),
    "frame.toml": (BUILDING, mr.buildings.read_building),
    "sample.toml": (files("mrwork.cli").joinpath("samples", "study.toml").read_text(), mr.read_study),
    "tuned.toml": (TUNED + tuning_samples.TUNE, mr.read_study),
}


@pytest.mark.parametrize("name", FILES)
@examples(40)
@given(data=st.data())
def test_a_damaged_text_is_read_or_refused(
    name: str, data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    (text, read), path = FILES[name], tmp_path_factory.getbasetemp() / name
    path.write_text(text)
    assert is_read(lambda: read(path))
    path.write_bytes(content := data.draw(texts(text)))
    is_read(lambda: read(path))
    assert path.read_bytes() == content


@examples(20)
@given(data=st.data(), packed=st.booleans())
def test_a_damaged_file_of_matlab_is_read_or_refused(
    data: st.DataObject, packed: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "rig.mat"
    savemat(path, clean_columns(), do_compression=packed)
    path.write_bytes(data.draw(blobs(path)))
    is_read(lambda: mr.read_damper_test(path))


COMMANDS = {
    "fit": "identify 10.csv --model viscous_dahl --every 2 --threads 1 --quiet --out fit",
    "study": "respond small.toml --threads 1 --quiet --out study",
    "tuning": "tune tuned.toml --quick --threads 1 --quiet --out tuning",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of each kind with its inputs, that of a fit with whatever other verbs add."""
    place = tmp_path_factory.mktemp("runs")
    tuning_samples.small_files(place)
    for stroke in (10, 14, 20):
        written_record(place / f"{stroke}.csv", stroke, noise=0.01)
    with chdir(place):
        for words in COMMANDS.values():
            assert mrwork(*words.split()).returncode == 0
    opened = reopen(place / "fit")
    others = [mr.read_damper_test(place / "14.csv"), mr.read_damper_test(place / "20.csv")]
    add_every_file(place / "fit", opened.fit, opened.tests[0], others, steps=20)
    return place


def says_the_same(damaged: bytes, whole: bytes) -> bool:
    """Whether a file is the same document still, as where only blanks were removed."""
    try:
        return damaged == whole or bool(json.loads(damaged) == json.loads(whole))
    except ValueError:
        return False


@pytest.mark.parametrize("kind", COMMANDS)
@examples(20)
@given(data=st.data())
def test_a_damaged_run_is_read_or_refused_and_not_replaced(
    kind: str, data: st.DataObject, folder: Path
) -> None:
    whole = {path: path.read_bytes() for path in sorted((folder / kind).rglob("*")) if path.is_file()}
    path = data.draw(st.sampled_from([each for each in whole if each.suffix in (".json", ".npz")]))
    damage = documents if path.suffix == ".json" and data.draw(st.integers(0, 9)) else blobs
    path.write_bytes(damaged := data.draw(damage(path)))
    try:
        accepted = is_read(lambda: mr.load(folder / kind))
        with chdir(folder):
            if accepted and kind == "fit":
                assert mrwork("predict", kind, "14.csv", "--json").returncode in (0, 2)
            if not says_the_same(damaged, whole[path]):
                ended = mrwork(*COMMANDS[kind].split())
                assert (ended.returncode, ended.stdout) == (2, "")
        assert {each: each.read_bytes() for each in whole} == whole | {path: damaged}
    finally:
        path.write_bytes(whole[path])


@pytest.mark.parametrize("name", ["frame.toml", "sample.toml"])
def test_arrays_beyond_the_depth_of_the_reader_are_refused(name: str, tmp_path: Path) -> None:
    (path := tmp_path / name).write_text(f"masses = {'[' * 3000}{']' * 3000}")
    assert not is_read(lambda: FILES[name][1](path))
