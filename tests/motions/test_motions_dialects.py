"""Any accelerations, written in any format, read back to the numbers of the file."""

from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import pytest
from examples import examples
from hypothesis import given
from motion_files import DT, at2_lines, cosmos_lines, esm_lines, knet_lines, write_lines
from numpy.typing import NDArray
from refusals import refusal
from scipy.io import savemat

from mrwork.base.units import FACTORS
from mrwork.closed_loop.evaluation import STANDARD_GRAVITY
from mrwork.motions import read_motion

Floats = NDArray[np.float64]

ENDS = st.sampled_from(["\n", "\r\n", "\r"])
# Up to 2 g, at rest in part.
SERIES = st.lists(
    (st.floats(-20.0, 20.0) | st.just(0.0)).map(lambda number: number if abs(number) > 1e-9 else 0.0),
    min_size=8,
    max_size=60,
).filter(any)


def in_file(numbers: Floats, form: str) -> Floats:
    return np.array([float(format(number, form)) for number in numbers])


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("dialects") / "motion"


@examples(25)
@given(series=SERIES, dt=st.sampled_from([".0050", "0.01", "1.0E-02", ".02"]), end=ENDS)
def test_at2(path: Path, series: list[float], dt: str, end: str) -> None:
    in_g = np.array(series) / STANDARD_GRAVITY
    write_lines(path, at2_lines(in_g, f"NPTS= {in_g.size}, DT= {dt} SEC"), end)
    motion = read_motion(path)
    assert motion.dt == float(dt)
    np.testing.assert_array_equal(motion.acceleration, STANDARD_GRAVITY * in_file(in_g, "15.7E"))


@examples(25)
@given(series=SERIES, end=ENDS)
def test_esm(path: Path, series: list[float], end: str) -> None:
    in_gal = 100.0 * np.array(series)
    write_lines(path, esm_lines(in_gal), end)
    motion = read_motion(path)
    assert motion.dt == DT
    np.testing.assert_array_equal(motion.acceleration, 0.01 * in_file(in_gal, ".6f"))


@examples(25)
@given(
    series=SERIES,
    end=ENDS,
    layout=st.sampled_from(["(8F10.5)", "(10F8.3)", "(6F13.6)", "(1E15.6)", "(5E16.8)"]),
    step=st.sampled_from([5.0, 10.0, 20.0]),
    unit=st.sampled_from(["cm/s^2", "g", "cm/sec2(04)"]),
)
def test_cosmos(path: Path, series: list[float], end: str, layout: str, step: float, unit: str) -> None:
    factor = STANDARD_GRAVITY if unit == "g" else 0.01
    numbers = np.array(series) / (1.0 if unit == "g" else 0.1)
    write_lines(path, cosmos_lines(numbers, unit=unit, series_format=layout, step_ms=step), end)
    motion = read_motion(path)
    assert motion.dt == pytest.approx(1e-3 * step, rel=1e-12)
    form = layout.strip("()")
    form = form[form.index("E" if "E" in form else "F") + 1 :] + ("E" if "E" in form else "F")
    np.testing.assert_array_equal(motion.acceleration, factor * in_file(numbers, form))


@examples(25)
@given(seconds=st.integers(1, 3), offset=st.integers(-10000, 10000), rng=st.integers(0, 1000), end=ENDS)
def test_knet(path: Path, seconds: int, offset: int, rng: int, end: str) -> None:
    counts = np.random.default_rng(rng).integers(-9_000_00, 9_000_00, size=100 * seconds) + offset
    write_lines(path, knet_lines(counts, str(seconds)), end)
    motion = read_motion(path)
    per_count = 3920.0 / 6182761.0 / 100.0
    np.testing.assert_allclose(
        motion.acceleration, per_count * (counts - counts.mean()), rtol=1e-12, atol=1e-9
    )


@examples(30)
@given(
    series=SERIES,
    unit=st.sampled_from(sorted(FACTORS["acceleration"])),
    delimiter=st.sampled_from([",", ";", "\t", "  "]),
    end=ENDS,
    form=st.sampled_from(["r", ".9e", ".17g"]),
    mark=st.sampled_from(["", "# "]),
    comma=st.booleans(),
)
def test_table(
    path: Path, series: list[float], unit: str, delimiter: str, end: str, form: str, mark: str, comma: bool
) -> None:
    texts = [repr(number) if form == "r" else format(number, form) for number in series]
    rows = [f"{k / 100:.2f}{delimiter}{text}" for k, text in enumerate(texts)]
    alone = list(texts)
    if comma and delimiter != ",":
        rows, alone = ([text.replace(".", ",") for text in each] for each in (rows, alone))
    file = path.with_suffix(".csv")
    expected = FACTORS["acceleration"][unit] * np.array([float(text) for text in texts])
    write_lines(file, [f"{mark}t_s{delimiter}acc_{unit}", *rows], end)
    motion = read_motion(file)
    assert motion.dt == pytest.approx(0.01, rel=1e-9)
    np.testing.assert_array_equal(motion.acceleration, expected)
    write_lines(file, rows, end)
    np.testing.assert_array_equal(read_motion(file, unit=unit).acceleration, expected)
    write_lines(file, [delimiter.join(alone[k : k + 4]) for k in range(0, len(alone), 4)], end)
    np.testing.assert_array_equal(read_motion(file, unit=unit, dt=0.01).acceleration, expected)


@pytest.mark.parametrize("lines", [["0,12", "-0,05", "0,1"], ["3,4", "", "5,6"]])
def test_commas_that_may_be_decimal_are_refused_in_a_series(path: Path, lines: list[str]) -> None:
    refusal(read_motion, write_lines(path.with_suffix(".csv"), lines), unit="m/s2", dt=0.01, match="decimal")


@examples(30)
@given(series=SERIES, columns=st.booleans(), version=st.sampled_from(["4", "5"]), compressed=st.booleans())
def test_matlab(path: Path, series: list[float], columns: bool, version: str, compressed: bool) -> None:
    pair = np.stack([0.01 * np.arange(len(series)), series])
    file = path.with_suffix(".mat")
    savemat(file, {"quake": pair.T if columns else pair}, format=version, do_compression=compressed)
    motion = read_motion(file, unit="m/s2")
    assert motion.dt == pytest.approx(0.01, rel=1e-9)
    np.testing.assert_array_equal(motion.acceleration, series)
