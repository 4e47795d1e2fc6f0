"""The study of chapter 3 in its quick form, and properties of what it finds."""

from __future__ import annotations

from copy import deepcopy
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from result_tables import assert_alone, assert_filled

from mrwork.closed_loop import SCORE
from studies.chapter_3 import sized_front
from studies.chapter_3.findings import Chapter, chapter_of
from studies.chapter_3.models_on_one_test import NOISE, SHOWN_TEST
from studies.chapter_3.page import write_page
from studies.chapter_3.sized_frame import FORCES, PAIR, wishes
from studies.chapter_3.slot_flow import errors, slot_of, yield_stress
from studies.chapter_3.tables import tables
from studies.common.command import Work
from studies.common.expected import departures
from studies.common.frame import RECORDS


@pytest.fixture(scope="module")
def chapter(tmp_path_factory: pytest.TempPathFactory) -> Chapter:
    """The quick form, with decaying sines in the place of the measured records."""
    folder = tmp_path_factory.mktemp("records")
    time = 0.02 * np.arange(400)
    for number, (_, file) in enumerate(RECORDS):
        motion = np.sin((12.0 + 3.0 * number) * time) * np.exp(-0.5 * time)
        np.savetxt(
            folder / file, np.column_stack([time, motion]), delimiter=",", header="t_s,a_mps2", comments=""
        )
    return chapter_of(Work(quick=True, threads=1, records=folder))


def test_the_quick_form_finds_what_is_expected(chapter: Chapter) -> None:
    assert departures(chapter.found, Path("studies/chapter_3/expected.toml")) == []


def test_every_table_names_its_rows_and_fills_them(chapter: Chapter) -> None:
    assert_filled(chain(*tables(chapter.found).values()))


def test_the_dimensionless_yield_stress_alone_decides_the_error_of_plates() -> None:
    stresses = np.array([0.1, 1.0, 10.0])
    slot = slot_of(0.1)
    # Twice the flow at the same dimensionless stress is twice the yield stress.
    np.testing.assert_allclose(yield_stress(slot, 2e-5, stresses), 2.0 * yield_stress(slot, 1e-5, stresses))
    found = errors(stresses)
    assert np.all(abs(found["plates, gap 0.3 R"]) > abs(found["plates, gap 0.1 R"]))
    assert np.all(abs(found["sum, c of Yang"]) < abs(found["sum, c = 2"]))


def test_the_sized_damper_meets_its_wishes(chapter: Chapter) -> None:
    (damper,) = chapter.frame.designs.values()
    assert wishes(FORCES[0]).missed(damper) == {}


def test_the_front_has_what_it_tells(chapter: Chapter) -> None:
    pytest.importorskip("pymoo")
    assert chapter.front is not None
    chosen = chapter.found["quick_sized"]["front"]["chosen"]
    designs = chapter.front.designs
    assert chosen["smallest"]["volume_l"] == min(1e3 * each.envelope_volume for each in designs)
    largest = [each["dynamic_range"] for name, each in chosen.items() if name.startswith("range")]
    least = [each["power_w"] for name, each in chosen.items() if name.startswith("power")]
    # More volume never allows less.
    assert largest == sorted(largest)
    assert least == sorted(least, reverse=True)
    assert all(wishes(sized_front.FORCE).missed(each) == {} for each in designs)


def test_records_judge_what_the_synthetic_motions_chose(chapter: Chapter) -> None:
    for device in chapter.frame.loop.values():
        for way in ("constant", "clipped"):
            judged = device[way]["records"]
            assert judged["judged"] == pytest.approx(np.mean([judged[name] for name, _ in RECORDS]))
            assert judged["judged"] == pytest.approx(np.mean([judged[name] for name in SCORE]))
            assert judged["judged"] != device[way]["judged"]


def test_without_records_there_is_no_table_of_them(chapter: Chapter) -> None:
    found = deepcopy(chapter.found)
    for device in found["quick_sized"]["loop"].values():
        for way in ("constant", "clipped"):
            del device[way]["records"]
    assert len(tables(found)["loop"]) == len(tables(chapter.found)["loop"]) - 1


def test_a_constant_current_at_zero_leaves_the_pair_as_it_is(chapter: Chapter) -> None:
    assert chapter.frame.loop[PAIR]["scores"][0] == pytest.approx(1.0, abs=1e-12)


def test_no_model_is_better_than_the_noise_and_the_truth_comes_near_it(chapter: Chapter) -> None:
    rms = {model: each["rms_n"] for model, each in chapter.found["models"][SHOWN_TEST].items()}
    # The rms of 2001 white samples scatters by 1.6 %; sensors of the motion add to that of the force.
    assert min(rms.values()) == rms["bouc_wen"] > 0.95 * NOISE
    assert rms["bouc_wen"] < 1.2 * NOISE


def test_the_page_stands_alone(chapter: Chapter, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    write_page(chapter, page)
    assert_alone(page, pictures=10)
