"""`mr.study_of` makes the study that a file makes, and `to_toml` writes the file: same numbers, same refusals."""

import tomllib
from math import tanh
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from refusals import refusal
from test_study_keys import SOUND
from tuning_samples import study_file

import mrwork as mr

# Their names are no promise: how studies are compared, and how a file is read before its laws are designed.
from mrwork.base.documents import read_table
from mrwork.base.keys import given_in, toml_text
from mrwork.base.places import Place
from mrwork.control.laws.regulator_settings import RegulatorSettings
from mrwork.study.schema import StudyTable
from mrwork.study.study import study_fingerprint
from mrwork.study.study_file import write_study_file

ROOT = Path(__file__).parents[2]
FILES = (ROOT / "python/mrwork/cli/samples/study.toml", *sorted((ROOT / "studies").rglob("*.toml")))
# Their laws are designed for as long as those of all other files take together.
SLOW = {
    "studies/respond/five_storeys.toml",
    "studies/rollout/yields.toml",
    *(
        f"studies/rollout/{use}_{level}.toml"
        for use in ("level", "chosen", "robust_level", "robust_chosen")
        for level in ("01", "03")
    ),
}


def read_tables(document: dict[str, Any]) -> StudyTable:
    return read_table(StudyTable, document, Place(origin="study"))


TEXTS = {str(path.relative_to(ROOT)): text for path in FILES if "[[motion]]" in (text := path.read_text())}
TEXTS["a study of every table"] = toml_text(SOUND)
ARGUMENTS = {"damper": "dampers", "controller": "laws", "baseline": "baselines", "motion": "motions"}
Samples = NDArray[np.float64]

UTS = mr.building("uts")
PAIR = {"storey": 1, "preset": "kwok2006"}
NOISE = mr.synthetic_motion(rng=0, duration=3.0, peak=3.0)
TIME = np.arange(0.0, 20.0, 0.01)
SLOPE = 5.0
WEIGHTS = np.array([1.0, 0.5])


def clip(command: Samples) -> Samples:
    return np.minimum(command, tanh(2.0))


def brake(sample: mr.closed_loop.LoopSample, memory: Samples) -> Samples:
    return clip(SLOPE * WEIGHTS[0] * np.abs(sample.rate))


def in_python(document: dict[str, Any], folder: Path) -> mr.Study:
    """The study of the tables of a file."""
    arguments = {ARGUMENTS.get(name, name): value for name, value in document.items()}
    return mr.study_of(**arguments | {"folder": folder / document.get("folder", "")})


def rewritten(study: mr.Study, folder: Path) -> mr.Study:
    return mr.read_study(study.to_toml(folder / "written" / "study.toml"))


def quick(**changed: Any) -> mr.Study:
    given: dict[str, Any] = {"building": UTS, "dampers": [PAIR], "laws": ["passive_on"], "motions": [NOISE]}
    return mr.study_of(**given | changed)


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_tables_are_written_as_they_were_read(text: str, tmp_path: Path) -> None:
    table = read_tables(tomllib.loads(text))
    folder = (tmp_path / table.folder).resolve()
    write_study_file(table, folder, 0, tmp_path / "out" / "study.toml", replace=False)
    written = tomllib.loads((tmp_path / "out" / "study.toml").read_text())
    named = (tmp_path / "out" / written.pop("folder", "")).resolve()
    assert named in (folder, (tmp_path / "out").resolve())
    given = given_in(table)
    given.pop("folder", "")
    assert given_in(read_tables(written)) == given


@pytest.mark.parametrize("name", [name for name in TEXTS if name not in SLOW])
def test_a_study_file_is_rebuilt_in_python_and_written_again(name: str, tmp_path: Path) -> None:
    path = ROOT / name
    # Studies name the records where they lie beside the project.
    if "shared/data" in TEXTS[name] and not (ROOT.parent / "shared" / "data").is_dir():
        pytest.skip("the measured records of this study are not beside the project")
    if not path.is_file():
        path = tmp_path / "study.toml"
        path.write_text(TEXTS[name])
    expected = study_fingerprint(mr.read_study(path))
    study = in_python(tomllib.loads(TEXTS[name]), path.parent)
    assert study_fingerprint(study) == expected
    assert study_fingerprint(rewritten(study, tmp_path)) == expected


def test_what_is_tuned_is_rebuilt(tmp_path: Path) -> None:
    path = study_file(tmp_path)
    expected = mr.read_study(path).tunes
    study = in_python(tomllib.loads(path.read_text()), tmp_path)
    given = given_in(expected[0])
    assert [given_in(each) for each in (*study.tunes, *rewritten(study, tmp_path).tunes)] == [given, given]
    table = mr.study.TuneTable(laws=["lyapunov"], free={"scale": (1.0, 2.0)})
    training = {"synthetic": "kanai_tajimi", "duration": 3.0, "use": "training"}
    assert quick(tune=table, motions=[training, NOISE]).tunes[0].free == {"scale": (1.0, 2.0)}


def test_values_are_written_beside_the_file_and_read_back(tmp_path: Path) -> None:
    tuned = mr.buildings.with_tuned_mass(UTS, floor=5, mass=10.0, frequency=3.0, ratio=0.1)
    rubber = mr.buildings.with_lead_rubber_bearings(tuned, mass=300.0, period=2.0, yield_force=50.0)
    samples = np.random.default_rng(0).normal(size=80)
    grouped = mr.GroundMotion(name="own", dt=0.013, acceleration=samples, groups=("soft", "pulse"))
    study = mr.study_of(
        building={"file": tuned},
        dampers=[{**PAIR, "differential": True}],
        laws=[
            brake,
            {"law": brake, "label": "slower", "user": {"memory": 1, "rms_time": "2 s"}},
            mr.closed_loop.UserLaw(name="a value", command=brake, n_memory=2, rms_time=1.0),
            {"law": "clipped_optimal", "gain": np.full((1, 12), 1e3)},
            {"law": "inverse_direct", "settings": RegulatorSettings(control_weight=1e-9)},
        ],
        baselines=[{"label": "rubber", "building": {"file": rubber}}],
        motions=[
            {"file": grouped, "pga": ["0.1 g", "0.2 g"], "group": "mine"},
            {"acceleration": samples[:40], "dt": 0.02, "unit": "g"},
        ],
        hardware=mr.Hardware(feedback="observer", measured_floors=(0, 4), acceleration_noise=0.01),
        uncertainty={"delay": "1 ms", "realisations": 2},
        seed=3,
        title="Of values",
    )
    written = study.to_toml(tmp_path / "study.toml")
    assert "folder" not in written.read_text()
    # It can be moved with what is beside it.
    moved = (tmp_path / "study.toml").rename(tmp_path / "moved.toml")
    again = mr.read_study(moved, seed=3)
    assert study_fingerprint(again) == study_fingerprint(study)
    assert [each.groups for each in again.grounds] == [each.groups for each in study.grounds]
    assert again.building.n_strokes == 1
    assert [each.row.label for each in again.arrangements] == [each.row.label for each in study.arrangements]
    results = mr.run_study(study, threads=1)
    assert mr.run_study(again, threads=1).to_pandas().equals(results.to_pandas())


def test_a_fit_stands_in_a_study_as_its_folder_does(tmp_path: Path) -> None:
    spec = mr.damper("bingham").with_current_laws({"f_c": "linear"}, unit="A")
    loading = mr.Loading(dt=0.01, displacement=0.01 * np.sin(TIME), velocity=0.01 * np.cos(TIME))
    motion = {"time": TIME, "displacement": loading.displacement, "velocity": loading.velocity}
    shape = np.tanh(100.0 * loading.velocity)
    tests = [
        mr.test_from_arrays(**motion, force=(500.0 + 900.0 * current) * shape, current=current)
        for current in (0.0, 1.0)
    ]
    fit = mr.identify(spec, tests, threads=1)
    study = quick(dampers=[{"storey": 1, "run": fit, "count": 2}])
    assert study.devices[0].tested == fit.tested
    written = study.to_toml(tmp_path / "study.toml")
    assert study_fingerprint(mr.read_study(written)) == study_fingerprint(study)
    run = mr.load(tmp_path / "study_files" / "damper_1", mr.StoredRun)
    assert run.fit == fit
    for each in (run, run.place):
        again = quick(dampers=[{"storey": 1, "run": each, "count": 2}])
        assert study_fingerprint(again) == study_fingerprint(study)


def test_a_study_names_the_folder_of_its_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "records").mkdir()
    np.savetxt(tmp_path / "records" / "one.txt", NOISE.acceleration)
    monkeypatch.chdir(tmp_path)
    study = quick(motions=[{"file": "records/one.txt", "dt": 0.01, "unit": "m/s2"}])
    monkeypatch.chdir(ROOT)
    assert study_fingerprint(rewritten(study, tmp_path)) == study_fingerprint(study)
    assert 'folder = ".."' in (tmp_path / "written" / "study.toml").read_text()
    study.to_toml(tmp_path / "study.toml")
    assert "folder" not in (tmp_path / "study.toml").read_text()


def test_functions_of_other_values_are_told_apart() -> None:
    def law_of(gain: float) -> Any:
        def law(sample: mr.closed_loop.LoopSample, memory: Samples) -> Samples:
            return gain * np.abs(sample.rate)

        return law

    one, other, same = (study_fingerprint(quick(laws=[law_of(gain)])) for gain in (1.0, 2.0, 1.0))
    assert one == same != other


@pytest.mark.parametrize(
    ("wrong", "word"),
    [
        ({"building": {"mases": [300.0], "stiffnesses": [1e5]}}, "building.mases"),
        ({"dampers": ["kwok2006"]}, r"`dampers\[0\]`"),
        ({"dampers": [{**PAIR, "storey": 9}]}, r"dampers\[0\].storey: .*no storey 9"),
        ({"laws": [lambda sample: sample]}, "a function of 2 arguments"),
        ({"motions": [NOISE, NOISE]}, "another name"),
        ({"motions": [{"acceleration": NOISE.acceleration}]}, "no dt"),
        ({"hardware": mr.Hardware(seed=3)}, "give it as `seed`"),
        ({"controllers": []}, "did you mean laws"),
    ],
)
def test_a_wrong_argument_is_refused_by_its_name(wrong: dict[str, Any], word: str) -> None:
    refusal(quick, **wrong, match=word)


def test_what_cannot_be_written_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    training = {"synthetic": "kanai_tajimi", "duration": 3.0, "use": "training"}
    refusal(quick(motions=[training, NOISE]).of_use("test").to_toml, path, match="has not the motions")
    refusal(quick(laws=[lambda sample, memory: 0.0 * sample.rate]).to_toml, path, match="has no text")
    unwritable = object()

    def law(sample: mr.closed_loop.LoopSample, memory: Samples) -> Samples:
        return 0.0 * sample.rate if unwritable else sample.rate

    refusal(quick(laws=[law]).to_toml, path, match="uses unwritable")
    assert not any(tmp_path.iterdir())
    study = quick()
    study.to_toml(path)
    refusal(study.to_toml, path, match="replace=True")
    study.to_toml(path, replace=True)
