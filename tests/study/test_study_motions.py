"""The ground motions of a study."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from refusals import refusal

import mrwork as mr
from mrwork.base.documents import read_table
from mrwork.base.places import Place
from mrwork.motions import GroundMotion, en_1998_spectrum, response_spectrum, suite, synthetic_motion
from mrwork.motions.spectrum import Intensity
from mrwork.study import MotionOfStudy
from mrwork.study.motions import Aims, BareMotion, bare_motions, motions_of_study
from mrwork.study.reading import parse
from mrwork.study.schema import MotionTable


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    time = np.arange(0.0, 10.0, 0.01)
    rows = "\n".join(f"{t:.2f},{a:.9g}" for t, a in zip(time, np.sin(3.0 * time) + 0.2, strict=True))
    (tmp_path / "swing.csv").write_text(f"t_s,acceleration_mps2\n{rows}\n")
    return tmp_path


AIMS = Aims(first_period=0.8, weight=1e6, target=en_1998_spectrum(2.0, "B"), target_period=0.5)


def tables(*texts: str, folder: Path = Path(), seed: int = 0) -> tuple[MotionOfStudy, ...]:
    """The motions of tables, each with lines of its own."""
    bare: list[BareMotion] = []

    def read(place: Place, table: object) -> None:
        if isinstance(table, MotionTable):
            bare.extend(bare_motions(table, len(bare), folder, seed, ("floor 1", "roof")))

    for text in texts:
        document, lines = parse(text, "study.toml")
        place = Place(origin="study.toml", lines=lines, on_table=read)
        read_table(MotionTable, document, place)
    return motions_of_study(bare, AIMS)


def motions(text: str, folder: Path = Path(), seed: int = 0) -> tuple[GroundMotion, ...]:
    return tuple(motion.ground for motion in tables(text, folder=folder, seed=seed))


def test_each_peak_gives_a_motion_of_its_own(folder: Path) -> None:
    low, high = motions('file = "swing.csv"\nname = "swing"\npga = ["0.1 g", "0.3 g"]', folder)
    assert (low.name, high.name) == ("swing, 0.1 g", "swing, 0.3 g")
    assert low.peak == pytest.approx(0.980665)
    assert high.acceleration == pytest.approx(3.0 * low.acceleration)


def test_each_spectral_acceleration_gives_a_motion_of_its_own(folder: Path) -> None:
    text = 'file = "swing.csv"\nname = "swing"\n'
    low, high = tables(text + 'sa = ["0.1 g", "0.3 g"]', folder=folder)
    assert (low.facts.name, high.facts.name) == ("swing, Sa 0.1 g", "swing, Sa 0.3 g")
    assert high.ground.groups == ("Sa 0.3 g",)
    assert low.facts.record == high.facts.record == "swing"
    (own,) = tables(text + "sa = 2.0\nsa_period = 0.4\nsa_damping = 0.02", folder=folder)
    assert own.facts.name == "swing"
    for motion, value, period, damping in (
        (low, 0.980665, 0.8, 0.05),
        (high, 3 * 0.980665, 0.8, 0.05),
        (own, 2.0, 0.4, 0.02),
    ):
        spectrum = response_spectrum(motion.ground, [period], damping=damping)
        assert spectrum.pseudo_acceleration[0] == pytest.approx(value, rel=1e-12)
        assert motion.facts.intensity == Intensity(
            measure="sa", value=value, period=period, damping_ratio=damping
        )


@pytest.mark.parametrize(
    ("by", "expected"),
    [
        ("pga", Intensity(measure="pga", value=2.4)),
        # Of the plateau, 2.5 a_g S.
        ("sa", Intensity(measure="sa", value=6.0, period=0.5, damping_ratio=0.05)),
        ("least_squares", None),
    ],
)
def test_a_motion_is_scaled_to_the_target_and_then_by_factors(
    folder: Path, by: str, expected: Intensity | None
) -> None:
    half, whole = tables(
        f'file = "swing.csv"\nname = "swing"\nscale_to = "{by}"\nfactor = [0.5, 1]', folder=folder
    )
    assert (half.facts.name, whole.facts.name) == ("swing x 0.5", "swing x 1")
    assert half.ground.acceleration == pytest.approx(0.5 * whole.ground.acceleration)
    assert whole.facts.intensity is not None
    assert half.facts.intensity == replace(
        whole.facts.intensity, value=pytest.approx(0.5 * whole.facts.intensity.value)
    )
    if expected is None:
        assert whole.facts.intensity.name == "Sa(0.5 s, 5 %)"
    else:
        assert whole.facts.intensity == replace(expected, value=pytest.approx(expected.value))


def test_a_motion_is_cut_before_its_time_axis_is_stretched(folder: Path) -> None:
    (motion,) = motions('file = "swing.csv"\nstart = 2\nend = 7\ntime_scale = 0.2\nrest = 1', folder)
    assert motion.duration == pytest.approx(5.0 * 0.2 + 1.0)
    assert len(motion.changes) == 3
    assert (motion.acceleration[-100:] == 0.0).all()


def test_a_baseline_of_order_zero_takes_the_mean_off(folder: Path) -> None:
    (motion,) = motions('file = "swing.csv"\nbaseline = 0', folder)
    assert motion.acceleration.mean() == pytest.approx(0.0, abs=1e-12)


def test_the_seed_of_the_command_line_changes_a_synthetic_motion() -> None:
    text = 'synthetic = "clough_penzien"\nduration = 5\n'
    (one,), (same,), (other,) = motions(text), motions(text), motions(text, seed=1)
    assert np.array_equal(one.acceleration, same.acceleration)
    assert not np.array_equal(one.acceleration, other.acceleration)
    (table,) = motions(text + "seed = 1")
    assert np.array_equal(table.acceleration, other.acceleration)


def test_the_intensity_of_the_soil_scales_the_motion() -> None:
    text = 'synthetic = "kanai_tajimi"\nduration = 5\nsoil = { intensity = %g }'
    (weak,), (strong,) = motions(text % 0.01), motions(text % 0.04)
    assert strong.acceleration == pytest.approx(2.0 * weak.acceleration)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("factor = 1", "needs a file, samples"),
        ('file = "swing.csv"\nfactor = 1\npga = 1', "line 3: .*keep one of factor, pga"),
        ('file = "swing.csv"\nsa_period = 1', "line 2: sa_period is of sa"),
        ('file = "swing.csv"\nscale_to = "sa"\nsa = 1', "keep one of sa, scale_to"),
        ("suite = { motions = 2 }\nduration = 5", "line 2: duration is for a single"),
        ('file = "*.AT2"', "line 1: no file matches"),
        ('synthetic = "kanai_tajimi"\nunit = "g"', "line 2: unit is for files"),
        ('synthetic = "kanai_tajimi"\nsoil = { high_pass_damping = 1 }', "belongs to clough_penzien"),
        ('file = "swing.csv"\nstart = 20', "it lasts 9.99 s"),
        ('file = "swing.csv"\nduration = 5', "is of synthetic motions"),
        ('file = "swing.csv"\nchannel = 1', "takes no `channel`"),
        ('file = "swing.csv"\ndt = 0.02', "holds the times"),
        ('file = "swing.csv"\npga = 300.0', "beyond any earthquake"),
    ],
)
def test_a_motion_that_cannot_be_is_refused_by_what_is_wrong(folder: Path, text: str, word: str) -> None:

    refusal(motions, text, folder, match=word)


def test_every_record_of_a_folder_or_pattern_is_a_motion(folder: Path) -> None:
    records = folder / "records"
    records.mkdir()
    for name in ("b.csv", "a.csv"):
        (records / name).write_text((folder / "swing.csv").read_text())
    (records / "README.md").write_text("Where these are from.")
    (records / ".listing").write_text("b a")
    (records / "others").mkdir()
    whole = motions('file = "records"\npga = [1.0, 2.0]', folder)
    assert [motion.name for motion in whole] == ["a, 0.102 g", "a, 0.204 g", "b, 0.102 g", "b, 0.204 g"]
    assert [motion.source for motion in whole[::2]] == ["a.csv", "b.csv"]
    named = motions('file = "records/*.csv"\nname = "Rig"\ngroup = "measured"', folder)
    assert [motion.name for motion in named] == ["Rig, a", "Rig, b"]
    assert {motion.groups for motion in named} == {("measured",)}
    (records / "c.csv").write_text("not a record")
    refusal(motions, 'file = "records"', folder, match=r"c\.csv")


def test_a_suite_is_that_of_its_seed() -> None:
    found = motions(
        'suite = { motions = 4, soils = ["firm"] }\nseed = 2\npga = "0.1 g"\nname = "Trial"', seed=3
    )
    drawn = suite("firm", 4, rng=5, name="Trial")
    for one, other in zip(found, drawn, strict=True):
        assert one.name == other.name
        assert one.acceleration == pytest.approx(other.acceleration * (0.980665 / other.peak), rel=1e-12)
        assert one.groups == (*other.groups, "0.1 g")


TRAINING = 'file = "swing.csv"\nname = "one"\nuse = "training"'


def write_noise(folder: Path, name: str, seed: int = 1, factor: float = 1.0) -> None:
    samples = factor * synthetic_motion(duration=9.99, rng=seed).acceleration
    rows = "\n".join(f"{0.01 * k:.2f},{a:.9g}" for k, a in enumerate(samples))
    (folder / name).write_text(f"t_s,acceleration_mps2\n{rows}\n")


@pytest.mark.parametrize(
    "test",
    [
        'file = "swing.csv"\nname = "other"\nstart = 6',
        'file = "copy.csv"\nfactor = -2',
        'file = "copy.csv"\nstart = 1\nend = 8\npga = [1, 2]',
        'file = "copy.csv"\ntime_scale = 0.2',
    ],
)
def test_a_record_is_not_for_training_and_for_testing(folder: Path, test: str) -> None:
    for name in ("swing.csv", "copy.csv"):
        write_noise(folder, name)
    refusal(tables, TRAINING, test, folder=folder, match="are of one file|are one record.*correlation 1.000")


def test_suites_of_other_seeds_may_be_for_training(folder: Path) -> None:
    text = 'suite = { motions = 12 }\nname = "%s"\nseed = %d\nuse = "%s"'
    found = tables(text % ("Training", 1, "training"), text % ("Test", 2, "test"), folder=folder)
    assert [motion.facts.use for motion in found] == ["training"] * 12 + ["test"] * 12
    assert all(motion.facts.synthetic for motion in found)
    same = (text % ("Training", 1, "training"), text % ("Test", 1, "test"))
    refusal(tables, *same, folder=folder, match="are one record")


def test_a_doubtful_record_is_told_and_its_size_only_where_it_is_kept(folder: Path) -> None:
    (swing,) = tables('file = "swing.csv"', folder=folder)
    assert swing.remarks[0].code == "acceleration_offset"
    (folder / "weak.csv").write_text((folder / "swing.csv").read_text().replace("mps2", "mm/s2"))
    sizes = [
        [each for each in tables(text, folder=folder)[0].remarks if each.code == "acceleration_unusual"]
        for text in (
            'file = "weak.csv"',
            'file = "weak.csv"\npga = "0.1 g"',
            'file = "weak.csv"\nfactor = 1000',
        )
    ]
    assert [len(each) for each in sizes] == [1, 0, 0]


BUILDING = """
[building]
n_storeys = 1
masses = ["20 t"]
stiffnesses = ["12 kN/mm"]
height = "3 m"
modal_damping = { ratios = ["2 %"] }
"""


def study_with(folder: Path, *motions: str) -> mr.Study:
    file = folder / "study.toml"
    file.write_text(BUILDING + "".join(f"\n[[motion]]\n{motion}\n" for motion in motions))
    return mr.read_study(file)


def test_copies_are_told_and_are_one_record_of_a_fragility(folder: Path) -> None:
    for name, seed, factor in (("one", 1, 1.0), ("two", 1, -3.0), ("three", 2, 1.0)):
        write_noise(folder, f"{name}.csv", seed, factor)
    levels = 'pga = ["0.1 g", "0.5 g"]'
    study = study_with(folder, *(f'file = "{name}.csv"\n{levels}' for name in ("one", "two", "three")))
    (found_copy,) = [each for each in study.remarks if each.code == "records_copied"]
    assert found_copy.words == ("one", "two")
    results = mr.run_study(study)
    assert found_copy in results.remarks
    found = mr.fragility(results, limit={"peak_drift_ratio": 0.005})
    assert [each.record for each in found["uncontrolled"].crossings] == ["one", "three"]
    assert found_copy in found.remarks


def test_levels_of_a_record_and_synthetic_motions_are_no_copies(folder: Path) -> None:
    levels = (
        'file = "swing.csv"\npga = "0.1 g"\nname = "low"',
        'file = "swing.csv"\npga = "0.3 g"\nname = "high"',
    )
    study = study_with(folder, *levels, 'suite = { motions = 6, soils = ["firm"] }')
    assert "records_copied" not in [each.code for each in study.remarks]
    # They are the levels of one record.
    assert [motion.facts.copy_of for motion in study.motions[:3]] == ["", "low", ""]
