"""The ground motions of a study."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mrwork.errors import SettingError
from mrwork.keys import Place
from mrwork.motions import GroundMotion
from mrwork.study.declared import read_table
from mrwork.study.lines import parse
from mrwork.study.motions import motions_of
from mrwork.study.schema import MotionTable


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    time = np.arange(0.0, 10.0, 0.01)
    rows = "\n".join(f"{t:.2f},{a:.9g}" for t, a in zip(time, np.sin(3.0 * time) + 0.2, strict=True))
    (tmp_path / "swing.csv").write_text(f"t_s,acceleration_mps2\n{rows}\n")
    return tmp_path


def motions(text: str, folder: Path = Path(), seed: int = 0) -> tuple[GroundMotion, ...]:
    document, lines = parse(text, "study.toml")
    return motions_of(
        read_table(MotionTable, document, Place(origin="study.toml", lines=lines)), folder, seed
    )


def test_each_peak_gives_a_motion_of_its_own(folder: Path) -> None:
    low, high = motions('file = "swing.csv"\nname = "swing"\npga = ["0.1 g", "0.3 g"]', folder)
    assert (low.name, high.name) == ("swing, 0.1 g", "swing, 0.3 g")
    assert low.peak == pytest.approx(0.980665)
    assert high.acceleration == pytest.approx(3.0 * low.acceleration)


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
    ("text", "message"),
    [
        ("factor = 1", "the study needs either a file or a synthetic motion"),
        (
            'synthetic = "kanai_tajimi"\nfile = "swing.csv"',
            "needs either a file or a synthetic motion",
        ),
        (
            'file = "swing.csv"\nfactor = 1\npga = 1',
            r"line 3: a motion is scaled by factor or to a pga; keep one",
        ),
        ('synthetic = "kanai_tajimi"\nunit = "g"', r"line 2: unit is for files"),
        (
            'synthetic = "kanai_tajimi"\nsoil = { high_pass_damping = 1 }',
            r"line 2: .* belongs to clough_penzien",
        ),
        ('file = "gone.csv"', r"line 1: .*gone\.csv"),
        ('file = "swing.csv"\nstart = 20', r"study\.toml.*20"),
    ],
)
def test_a_mistake_is_one_sentence_with_its_line(folder: Path, text: str, message: str) -> None:
    with pytest.raises(SettingError, match=message) as refused:
        motions(text, folder)
    assert str(refused.value).startswith("study.toml")
    assert "\n" not in str(refused.value)
