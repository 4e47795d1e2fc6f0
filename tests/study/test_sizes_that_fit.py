"""What would not fit into memory is refused with an estimate, before anything is allocated."""

from __future__ import annotations

from pathlib import Path

from sentences import Refused

from mrwork.buildings import read_building, shear_building
from mrwork.dampers import damper
from mrwork.motions import synthetic_motion
from mrwork.uncertainty.candidate_tests import read_candidates


def test_a_motion_of_too_many_samples_is_refused_with_its_size(refused: Refused) -> None:
    for duration, dt in ((1e12, 0.01), (30.0, 1e-12), (1e100, 1e-100)):
        refused(synthetic_motion, duration=duration, dt=dt)


def test_a_building_of_a_thousand_million_storeys_is_refused_with_its_size(
    tmp_path: Path, refused: Refused
) -> None:
    path = tmp_path / "tower.toml"
    path.write_text("masses = [1e3]\nstiffnesses = [1e6]\nn_storeys = 1_000_000_000\n")
    refused(read_building, path)
    refused(shear_building, name="tower", masses=[1e3] * 5000, stiffnesses=[1e6] * 5000)


def test_too_many_candidates_are_refused_with_their_size(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / "candidates.csv"
    path.write_text("amplitude,frequency\n" + "0.01,1\n" * 20_000)
    refused(read_candidates, path, damper("modified_bouc_wen"))
