"""The study of chapter 2 in its quick form, and properties of what it finds."""

from __future__ import annotations

from itertools import chain
from pathlib import Path

import pytest
from result_tables import assert_alone, assert_filled

import mrwork as mr
from studies.chapter_2.device_families import FAMILIES
from studies.chapter_2.findings import Chapter, chapter_of
from studies.chapter_2.page import write_page
from studies.chapter_2.tables import tables
from studies.common.command import Work
from studies.common.expected import departures

STUDY = Path("studies/chapter_2")


@pytest.fixture(scope="module")
def chapter() -> Chapter:
    return chapter_of(Work(quick=True, threads=1))


def test_the_quick_form_finds_what_is_expected(chapter: Chapter) -> None:
    assert departures(chapter.found, STUDY / "expected.toml") == []


def test_every_table_names_its_rows_and_fills_them(chapter: Chapter) -> None:
    assert_filled(chain(*tables(chapter.found).values()))


def test_every_family_lowers_the_score_and_its_energies_balance(chapter: Chapter) -> None:
    for name, each in chapter.found["quick_families"].items():
        assert each["synthetic"]["judged"] < 1.0, name
        assert each["synthetic"]["energy_error"] < 1e-5, name


def test_only_actuators_and_springs_give_power_to_the_frame(chapter: Chapter) -> None:
    found = chapter.found["quick_families"]
    dissipating = ("Viscous damper", "Liquid column, 2 %", "Variable orifice", "Variable friction")
    for name in dissipating:
        each = found[name]["synthetic"]
        assert each["power_given_w"] < 1e-3 * each["power_taken_w"], name
    for family in FAMILIES:
        if family.group == "active":
            each = found[family.name]["synthetic"]
            assert each["power_given_w"] > 0.1 * each["power_taken_w"], family.name


def test_the_page_stands_alone(chapter: Chapter, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    write_page(chapter, page)
    assert_alone(page, pictures=15)


@pytest.mark.parametrize(
    ("name", "model", "law"),
    [
        ("variable_orifice", "orifice", "clipped_optimal"),
        ("resettable_stiffness", "maxwell", "maximum_energy_dissipation"),
        ("valved_column", "orifice", "clipped_optimal"),
        ("smart_isolation", "static_hysteretic", "clipped_optimal"),
        ("mass_driver", "static_hysteretic", "active"),
    ],
)
def test_other_families_are_study_files_too(name: str, model: str, law: str) -> None:
    study = mr.read_study(STUDY / f"{name}.toml")
    last = study.arrangements[-1]
    assert {device.spec.name for device in last.devices} == {model}
    assert law in {each.law.name for each in study.arrangements if each.law is not None}


def test_the_study_file_has_every_passive_family() -> None:
    study = mr.read_study(STUDY / "families.toml")
    baselines = {each.row.label for each in study.arrangements if each.row.kind == "baseline"}
    assert baselines == {family.name for family in FAMILIES if family.group == "passive"}
