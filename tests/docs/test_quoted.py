"""Numbers that pages quote are those of their tables, and one that is not is named with its line."""

import tomllib
from pathlib import Path

import pytest

import quoted

ENTRIES = tomllib.loads((Path(quoted.__file__).parent / "quoted.toml").read_text())


@pytest.mark.parametrize("page", quoted.pages(), ids=lambda page: page.name)
def test_pages_quote_what_their_tables_have(page: Path) -> None:
    assert [*quoted.findings(page, ENTRIES)] == []


def test_a_number_that_its_table_does_not_have_is_named(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("first\n<!--=rig_median-->12<!--/--> %, <!--=nothing-->1<!--/-->\n")
    wrong, unknown = quoted.findings(page, ENTRIES)
    assert "page.md, line 2: 12 is quoted for rig_median, and the table has 93" in wrong
    assert "quoted.toml has no nothing" in unknown
    assert "93" in quoted.written("<!--=rig_median-->12<!--/-->", ENTRIES)
    assert quoted.number({**ENTRIES["tuned_gain_most"], "below": "Clipped-optimal, tuned"}) == "0"


@pytest.mark.parametrize(("key", "value"), [("row", "none"), ("column", "none"), ("table", "none/none")])
def test_a_reference_that_leads_nowhere_says_where_it_ends(key: str, value: str) -> None:
    with pytest.raises(LookupError, match="none"):
        quoted.number({**ENTRIES["rig_median"], key: value})
