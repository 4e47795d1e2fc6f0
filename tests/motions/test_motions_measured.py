"""Records of the structural control benchmarks and PEER files in circulation are read correctly."""

import itertools

import measured_data
import numpy as np
import pytest
from refusals import refusal

from mrwork.closed_loop.evaluation import STANDARD_GRAVITY
from mrwork.motions import read_motion, read_motions
from mrwork.motions.ground_motion import is_copy

DATA = measured_data.DATA / "records"

pytestmark = pytest.mark.skipif(
    not DATA.is_dir(), reason=f"measured earthquake records are not at {DATA} (set MRWORK_DATA)"
)


@pytest.mark.parametrize(
    ("name", "peak", "dt"),
    [
        ("el_centro_1940_ns", 3.417, 0.02),
        ("hachinohe_1968_ns", 2.250, 0.01),
        ("kobe_1995_jma_ns", 8.178, 0.02),
        ("northridge_1994_sylmar_ns", 8.268, 0.0200067),
    ],
)
def test_benchmark_records_have_their_published_peaks(name: str, peak: float, dt: float) -> None:
    motion = read_motion(DATA / f"{name}.csv")
    assert round(motion.peak, 3) == peak
    assert motion.dt == pytest.approx(dt, rel=1e-4)


@pytest.mark.skipif(not (DATA / "real").is_dir(), reason=f"no folder {DATA / 'real'}")
def test_every_record_of_the_folder_is_read_with_its_event_and_station() -> None:
    motions = {motion.name: motion for motion in read_motions(DATA / "real")}
    assert len(motions) == 16
    # Peaks [g] and steps [s] as their headers and the listing of the folder state them.
    for name, peak, dt in (
        ("CPM000", 1.497, 0.02),
        ("CHY028-N", 0.821, 0.005),
        ("CHY034-N", 0.310, 0.004),
        ("A-ELC180", 0.130, 0.01),
        ("PFT135", 0.131, 0.005),
    ):
        assert motions[name].peak / STANDARD_GRAVITY == pytest.approx(peak, abs=6e-4)
        assert motions[name].dt == dt
    assert motions["A-ELC180"].source.startswith("BORREGO MOUNTAIN 04/09/68 0230, EL CENTRO ARRAY #9, 180")
    assert all(motion.changes == () for motion in motions.values())


@pytest.mark.skipif(not (DATA / "real").is_dir(), reason=f"no folder {DATA / 'real'}")
def test_no_two_measured_records_are_copies_of_one() -> None:
    motions = (*read_motions(DATA / "real"), *read_motions(str(DATA / "*.csv")))
    assert not any(is_copy(one, other) for one, other in itertools.combinations(motions, 2))
    assert is_copy(
        read_motion(DATA / "el_centro_1940_ns.csv"), read_motion(DATA / "el_centro_1940_ns.mat", unit="m/s2")
    )


@pytest.mark.parametrize("name", ["kobe_1995_jma_ns", "northridge_1994_sylmar_ns"])
def test_a_longer_last_step_is_told_and_moves_no_sample(name: str) -> None:
    motion = read_motion(DATA / f"{name}.csv")
    table = np.loadtxt(DATA / f"{name}.csv", delimiter=",", skiprows=1)
    assert "steps that differ: 1," in motion.changes[0]
    np.testing.assert_allclose(motion.acceleration[: len(table) - 1], table[:-1, 1], atol=1e-10)


def test_padding_of_the_benchmark_file_is_dropped_and_told() -> None:
    padded = read_motion(DATA / "el_centro_1940_ns.mat", unit="m/s2")
    clean = read_motion(DATA / "el_centro_1940_ns.csv")
    assert "is padding" in padded.changes[0]
    np.testing.assert_allclose(padded.acceleration, clean.acceleration, atol=1e-12)
    assert padded.dt == pytest.approx(clean.dt, rel=1e-12)


# Samples, step and peak in g, from the first lines of the files and from the PEER database where listed.
AT2 = {
    "ARL360_crcrlf": (2000, 0.02, 0.308),
    "BORREGO_A-ELC180": (4000, 0.01, 0.130),
    "GM11": (8000, 0.005, 0.163),
    "H-E01140": (7807, 0.005, 0.139),
    "IELC180": (4000, 0.01, 0.313),
    "NGA_no_266_CHI192": (2692, 0.01, 0.092),
    "RSN1633_MANJIL_ABBAR--L": (2676, 0.02, 0.515),
}


@pytest.mark.parametrize("name", AT2)
def test_peer_files_found_in_the_wild_are_read(name: str) -> None:
    (path,) = (DATA / "at2").glob(f"{name}.*")
    motion = read_motion(path)
    n_time, dt, peak = AT2[name]
    assert (motion.n_time, motion.dt) == (n_time, dt)
    assert motion.peak / STANDARD_GRAVITY == pytest.approx(peak, abs=6e-4)
    assert motion.changes == ()


def test_what_only_pretends_to_be_a_peer_file_is_refused_and_the_others_are_read() -> None:
    pretenders = sorted((DATA / "at2").glob("not_really_at2_*"))
    assert pretenders
    for path in pretenders:
        refusal(read_motion, path, match=path.name)
    others = [path for path in (DATA / "at2").iterdir() if path not in pretenders]
    assert len(read_motions(others)) == len(AT2)
