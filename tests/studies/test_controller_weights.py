"""The study of designed weights in its quick form; its true loop on one measured record where that is at hand."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from result_tables import assert_filled

from studies.common.expected import departures
from studies.controller_weights.study import found_by
from studies.controller_weights.tables import tables

RECORDS = Path(os.environ.get("MRWORK_DATA", "../shared/data")) / "records"


@pytest.fixture(scope="module")
def found() -> dict[str, Any]:
    return found_by(quick=True, records=RECORDS, threads=1, say=lambda what: None)


def test_the_quick_form_finds_what_is_expected(found: dict[str, Any]) -> None:
    assert departures(found, Path("studies/controller_weights/expected.toml")) == []


def test_every_table_names_its_rows_and_fills_them(found: dict[str, Any]) -> None:
    assert_filled(tables(found))
