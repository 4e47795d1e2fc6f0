"""The quick form of each chapter: its numbers are those expected, its tables are filled and its page stands alone."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import Any

import measured_data
import numpy as np
import pytest
from blank_pictures import blank

from mrwork.closed_loop import SCORE
from studies.chapter_2.device_families import FAMILIES
from studies.chapter_3 import sized_front
from studies.chapter_3.models_on_one_test import NOISE, SHOWN_TEST
from studies.chapter_3.sized_frame import FORCES, PAIR, wishes
from studies.controller_weights.study import found_by as weights_found
from studies.controller_weights.tables import tables as weight_tables
from studies.former.command import Work
from studies.former.expected import departures
from studies.former.frame import RECORDS

STUDIES = measured_data.ROOT / "studies"
MEASURED = measured_data.DATA / "records"


def assert_filled(shown: Any) -> None:
    """Each row has a name, and a text below each heading."""
    for table in shown:
        assert table.rows, table.title
        assert {len(row) for row in table.rows} == {len(table.columns)}, table.title
        assert all(row[0] for row in table.rows), table.title


def families_balance(chapter: Any) -> None:
    """Every family lowers the score, its energies balance, and only actuators and springs give power to the frame."""
    found = {name: each["synthetic"] for name, each in chapter.found["quick_families"].items()}
    for name, each in found.items():
        assert each["judged"] < 1.0, name
        assert each["energy_error"] < 1e-5, name
    for name in ("Viscous damper", "Liquid column, 2 %", "Variable orifice", "Variable friction"):
        assert found[name]["power_given_w"] < 1e-3 * found[name]["power_taken_w"], name
    for family in FAMILIES:
        if family.group == "active":
            assert found[family.name]["power_given_w"] > 0.1 * found[family.name]["power_taken_w"]


def sizes_meet_their_wishes(chapter: Any) -> None:
    """The sized damper meets its wishes, more volume never allows less, and the truth comes near the noise."""
    (damper,) = chapter.frame.designs.values()
    assert wishes(FORCES[0]).missed(damper) == {}
    assert chapter.frame.loop[PAIR]["scores"][0] == pytest.approx(1.0, abs=1e-12)
    rms = {model: each["rms_n"] for model, each in chapter.found["models"][SHOWN_TEST].items()}
    # The rms of 2001 white samples scatters by 1.6 %; sensors of the motion add to that of the force.
    assert min(rms.values()) == rms["bouc_wen"] > 0.95 * NOISE
    assert rms["bouc_wen"] < 1.2 * NOISE
    for device in chapter.frame.loop.values():
        for way in ("constant", "clipped"):
            judged = device[way]["records"]
            assert judged["judged"] == pytest.approx(np.mean([judged[name] for name, _ in RECORDS]))
            assert judged["judged"] == pytest.approx(np.mean([judged[name] for name in SCORE]))
            assert judged["judged"] != device[way]["judged"]
    if chapter.front is not None:  # without pymoo
        chosen = chapter.found["quick_sized"]["front"]["chosen"]
        largest = [each["dynamic_range"] for name, each in chosen.items() if name.startswith("range")]
        least = [each["power_w"] for name, each in chosen.items() if name.startswith("power")]
        assert largest == sorted(largest)
        assert least == sorted(least, reverse=True)
        assert all(wishes(sized_front.FORCE).missed(each) == {} for each in chapter.front.designs)


def decaying_sines(folder: Path) -> Path:
    """What takes the place of the measured records."""
    time = 0.02 * np.arange(400)
    for number, (_, file) in enumerate(RECORDS):
        motion = np.sin((12.0 + 3.0 * number) * time) * np.exp(-0.5 * time)
        columns = np.column_stack([time, motion])
        np.savetxt(folder / file, columns, delimiter=",", header="t_s,a_mps2", comments="")
    return folder


# Half a minute; the designed weights stand for the others in every change.
@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "holds", "pictures"),
    [
        ("chapter_2", families_balance, 15),
        ("chapter_3", sizes_meet_their_wishes, 10),
    ],
)
def test_the_quick_form_of_a_chapter_finds_what_is_expected(
    name: str, holds: Callable[[Any], None], pictures: int, tmp_path: Path
) -> None:
    records = decaying_sines(tmp_path) if name == "chapter_3" else None
    findings, shown, page = (
        import_module(f"studies.{name}.{part}") for part in ("findings", "tables", "page")
    )
    chapter = findings.chapter_of(Work(quick=True, threads=1, records=records))
    assert departures(chapter.found, STUDIES / name / "expected.toml") == []
    holds(chapter)
    assert_filled(chain(*shown.tables(chapter.found).values()))
    if pictures:
        with blank():
            page.write_page(chapter, tmp_path / "report.html")
        text = (tmp_path / "report.html").read_text(encoding="utf-8")
        assert text.count("<svg") > pictures
        assert not [outside for outside in ('src="', "url(http", "<link", "<script") if outside in text]


def test_the_quick_form_of_designed_weights_finds_what_is_expected() -> None:
    found = weights_found(quick=True, records=MEASURED, threads=1, say=lambda what: None)
    assert departures(found, STUDIES / "controller_weights/expected.toml") == []
    assert_filled(weight_tables(found))
