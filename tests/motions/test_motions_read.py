"""A ground motion is the same for every format of its file."""

from pathlib import Path

import numpy as np
import pytest
from motion_files import (
    DT,
    N_TIME,
    accelerations,
    at2_lines,
    cosmos_lines,
    esm_lines,
    knet_lines,
    write_lines,
)
from numpy.testing import assert_allclose
from refusals import refusal
from scipy.io import savemat

from mrwork.closed_loop.evaluation import STANDARD_GRAVITY
from mrwork.motions import GroundMotion, read_motion, read_motions

A = accelerations()
IN_G = A / STANDARD_GRAVITY
IN_GAL = 100.0 * A


def assert_is_the_motion(motion: GroundMotion, atol: float) -> None:
    assert motion.dt == pytest.approx(DT, rel=1e-12)
    assert motion.n_time == N_TIME
    assert_allclose(motion.acceleration, A, atol=atol)


@pytest.mark.parametrize(
    "size",
    [
        f"NPTS=  {N_TIME}, DT= .0100",
        f"npts= {N_TIME}, dt= 0.01",
        f"{N_TIME}    0.0100    NPTS, DT",
        f"NPTS=   {N_TIME}, DT=   .0100 SEC, HP= 0.1 Hz",
    ],
)
def test_every_header_of_at2_is_read_whatever_the_extension(tmp_path: Path, size: str) -> None:
    motion = read_motion(write_lines(tmp_path / "peer.csv", at2_lines(IN_G, size), "\r\r\n"))
    assert_is_the_motion(motion, 1e-6 * STANDARD_GRAVITY)
    assert "EL CENTRO ARRAY #1" in motion.source


def test_counts_of_knet_are_scaled_and_freed_of_their_offset(tmp_path: Path) -> None:
    per_count = 3920.0 / 6182761.0 / 100.0
    counts = np.round(A[:200] / per_count).astype(np.int64) + 8009
    motion = read_motion(write_lines(tmp_path / "MYG0020601182325.NS", knet_lines(counts, "2")))
    assert motion.dt == pytest.approx(0.01, rel=1e-12)
    assert_allclose(motion.acceleration, A[:200] - A[:200].mean(), atol=per_count)
    # The offset of the published example, 8009 counts, is 5.078 gal.
    assert 8009 * 100.0 * per_count == pytest.approx(5.078, abs=5e-4)
    assert "offset of the recorder" in motion.changes[0]


def test_esm_is_read_in_its_unit(tmp_path: Path) -> None:
    motion = read_motion(write_lines(tmp_path / "IT.AMT..HGE.D.ACC.ASC", esm_lines(IN_GAL)))
    assert_is_the_motion(motion, 1e-8)
    assert motion.source.startswith("CENTRAL_ITALY, 20160824, AMT, HGE")
    old = [line for line in esm_lines(IN_GAL)[1:] if not line.startswith("DATA_TYPE")]
    assert_is_the_motion(read_motion(write_lines(tmp_path / "old.ASC", old)), 1e-8)


def test_cosmos_is_read_where_columns_touch(tmp_path: Path) -> None:
    lines = cosmos_lines(IN_GAL - 1000.0, series_format="(8F10.4)")
    assert " " not in lines[-3]
    motion = read_motion(write_lines(tmp_path / "b.v2c", lines))
    assert_allclose(motion.acceleration, A - 10.0, atol=1e-6)


def test_the_recorder_s_step_of_cosmos_stands_in(tmp_path: Path) -> None:
    lines = cosmos_lines(IN_GAL, step_ms=-999.0, recorder_step=DT)
    assert_is_the_motion(read_motion(write_lines(tmp_path / "c.v1", lines)), 1e-6)


def test_a_channel_of_cosmos_is_chosen_by_number(tmp_path: Path) -> None:
    lines = [
        *cosmos_lines(IN_GAL, title="Corrected velocity"),
        *cosmos_lines(IN_GAL),
        *cosmos_lines(2.0 * IN_GAL),
    ]
    path = write_lines(tmp_path / "three.v2", lines)
    assert_is_the_motion(read_motion(path, channel=2), 1e-5)
    assert read_motion(path, channel=3).peak == pytest.approx(2.0 * np.abs(A).max(), rel=1e-5)
    refusal(read_motion, path, match="holds 3 channels")
    refusal(read_motion, path, channel=1, match="line 1: the series is 'Corrected velocity'")


@pytest.mark.parametrize(
    ("head", "delimiter", "factor"),
    [
        ("t_s,a_mps2", ",", 1.0),
        ("Time (s);Acceleration (cm/s^2)", ";", 100.0),
        ("time\tacc_g", "\t", 1.0 / STANDARD_GRAVITY),
        ("t_ms,ground_accel_mm/s2", ",", 1000.0),
        ("# t_s,a_gal", ",", 100.0),
        ("time a_mps2", "  ", 1.0),
        ("t_s,a_m_per_s2", ",", 1.0),
        ("t_s,Acc [g]", ",", 1.0 / STANDARD_GRAVITY),
        ("% record of a shaking table\nt_s a_mps2", " ", 1.0),
    ],
)
def test_columns_are_known_by_their_names(tmp_path: Path, head: str, delimiter: str, factor: float) -> None:
    scale = 1e3 if "t_ms" in head else 1.0
    body = [f"{scale * DT * k:.6f}{delimiter}{factor * value:.12g}" for k, value in enumerate(A)]
    assert_is_the_motion(read_motion(write_lines(tmp_path / "a.txt", [head, *body])), 1e-9)


def test_two_columns_without_names_need_a_unit(tmp_path: Path) -> None:
    body = [f"  {DT * k:.4f}   {value:.12g}" for k, value in enumerate(IN_G)]
    path = write_lines(tmp_path / "a.txt", ["# El Centro", *body])
    assert_is_the_motion(read_motion(path, unit="g"), 1e-9)
    refusal(read_motion, path, match='unit="g"')
    refusal(read_motion, path, unit="g", dt=2 * DT, match="column '1' holds the times")


def test_a_column_is_chosen_where_several_may_be_it(tmp_path: Path) -> None:
    body = [f"{DT * k:.4f},{value:.12g},{-value:.12g}" for k, value in enumerate(A)]
    path = write_lines(tmp_path / "a.csv", ["t_s,EW (m/s2),NS (m/s2)", *body])
    assert_is_the_motion(read_motion(path, column="ew (m/s2)"), 1e-9)
    assert_allclose(read_motion(path, column="NS (m/s2)").acceleration, -A, atol=1e-9)
    refusal(read_motion, path, match='column="2"')


def test_a_g_is_no_acceleration_in_g(tmp_path: Path) -> None:
    body = [f"{DT * k:.4f},{value:.12g}" for k, value in enumerate(A)]
    path = write_lines(tmp_path / "a.csv", ["t,a_g", *body])
    refusal(read_motion, path, match='unit="g"')
    assert_is_the_motion(read_motion(path, unit="m/s2"), 1e-9)


def test_of_two_pairs_in_a_mat_file_one_is_named(tmp_path: Path) -> None:
    time = DT * np.arange(N_TIME)
    path = tmp_path / "a.mat"
    savemat(path, {"ns_gal": [time, IN_GAL], "ew_gal": [time, -IN_GAL]}, format="4")
    assert_is_the_motion(read_motion(path, column="ns_gal"), 1e-9)
    refusal(read_motion, path, match="'ns_gal', 'ew_gal'.*`column`")


@pytest.mark.parametrize("given", [{}, {"dt": DT}])
def test_the_times_of_a_column_are_as_long_as_it(tmp_path: Path, given: dict[str, float]) -> None:
    """A workspace has a sample time and times of other signals, and a `dt` that its times contradict is refused."""
    path, time = tmp_path / "a.mat", DT * np.arange(N_TIME)
    for others in ({"T": DT}, {"time": np.arange(9.0)}):
        savemat(path, {"ag": A, "t": time, **others})
        assert_is_the_motion(read_motion(path, unit="m/s2", column="ag", **given), 1e-12)
    savemat(path, {"ag": A, "t": time, "time": 3.0 * time})
    if given:
        assert_is_the_motion(read_motion(path, unit="m/s2", **given), 1e-12)
        refusal(read_motion, path, unit="m/s2", dt=2.0 * DT, match="a step of .* s where `dt` is 0.02 s")
    else:
        refusal(read_motion, path, unit="m/s2", match="'t' and 'time'.*; give the step as `dt`")
    savemat(path, {"T": A, "t": time})
    assert_is_the_motion(read_motion(path, unit="m/s2", column="T", **given), 1e-12)
    savemat(path, {"ag": A, "T": DT})
    refusal(read_motion, path, unit="m/s2", match="no column is time.*: dt=")


@pytest.mark.parametrize("of", ["structs", "pairs", "array"])
def test_of_motions_in_structs_one_is_named_by_its_path(tmp_path: Path, of: str) -> None:
    path, time = tmp_path / "a.mat", DT * np.arange(N_TIME)
    motions = [{"t_s": time, "ag": samples} for samples in (-A, A)]
    rows = np.array([tuple(motion.values()) for motion in motions], [("t_s", "O"), ("ag", "O")])
    column, content = "eq.kobe.ag", dict(zip(("ns", "kobe"), motions, strict=True))
    if of == "pairs":
        column, content = "eq.kobe", {"ns": np.array([time, -A]), "kobe": np.array([time, A])}
    elif of == "array":
        column, content = "eq(2).ag", rows
    savemat(path, {"eq": content, "note": "two records"})
    motion = read_motion(path, unit="m/s2", column=column)
    assert_is_the_motion(motion, 1e-12)
    assert f"'{column}' of a.mat; not used: variables 'eq" in motion.source
    assert "'note' (text)" in motion.source
    refusal(read_motion, path, unit="m/s2", match=r"may all be a ground motion.* column=\"")


def test_a_matrix_that_is_no_motion_does_not_hide_one(tmp_path: Path) -> None:
    path, time = tmp_path / "a.mat", DT * np.arange(N_TIME)
    savemat(path, {"B": np.ones((4, 2)), "a_mps2": A, "t_s": time})
    assert_is_the_motion(read_motion(path, unit="m/s2"), 1e-12)
    savemat(path, {"ns": np.array([time, A]), "a_mps2": A, "t_s": time})
    refusal(read_motion, path, unit="m/s2", match="'ns', 'a_mps2' may all be")


@pytest.mark.parametrize("above", [[], ["", "# of the NS component"]])
def test_a_record_of_peer_without_its_header_is_a_table(tmp_path: Path, above: list[str]) -> None:
    body = ["".join(f"{value:15.7e}" for value in IN_G[row : row + 5]) for row in range(0, N_TIME, 5)]
    path = write_lines(tmp_path / "a.AT2", [*above, *body])
    assert_is_the_motion(read_motion(path, unit="g", dt=DT), 1e-5)
    refusal(read_motion, path, match='unit="g", dt=')


def test_several_are_read_in_the_order_of_their_names(tmp_path: Path) -> None:
    for name in ("b", "a"):
        write_lines(tmp_path / f"{name}.csv", ["t_s,a_mps2", "0,1", "0.01,2"])
    assert [motion.name for motion in read_motions(tmp_path / "*.csv")] == ["a", "b"]
    assert [motion.name for motion in read_motions([tmp_path / "b.csv"])] == ["b"]
    refusal(read_motions, tmp_path / "*.at2", match="no file matches")


@pytest.mark.parametrize("begins", [20.0, -5.0])
def test_times_that_begin_elsewhere_are_counted_from_zero_and_said(tmp_path: Path, begins: float) -> None:
    lines = (f"{begins + DT * row:.3f},{value:.8g}" for row, value in enumerate(IN_G))
    path = write_lines(tmp_path / "late.csv", ["t_s,acceleration_g", *lines])
    motion = read_motion(path)
    assert_allclose(motion.acceleration, A, atol=1e-4)
    assert motion.changes == (f"times begin at {begins:g} s in the file, and are counted from 0 s",)
