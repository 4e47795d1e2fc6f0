"""JSON and TOML that would exhaust the parser or the program are refused, by the name of their file."""

from __future__ import annotations

from pathlib import Path

import pytest
from refusals import refusal

from mrwork.store.parse import json_value, toml_table
from mrwork.study import read_results, read_study

LONG = "1" * 400
JSON = ["[" * 100_000 + "]" * 100_000, '{"a":' * 3_000 + "1" + "}" * 3_000, LONG, "[NaN]", "", "{"]
TOML = [
    "x = " + "{a = " * 5_000 + "1" + "}" * 5_000,
    "a." * 20_000 + "a = 1",
    "x = 1\n[" + '"a" . ' * 20_000 + "a]",
    "x = {" + "a." * 20_000 + "a = 1}",
    f"x = {LONG}",
]


@pytest.mark.parametrize(
    ("name", "text"), [*(("a.json", each) for each in JSON), *(("a.toml", each) for each in TOML)]
)
def test_a_text_that_would_exhaust_its_parser_is_refused_in_a_phrase(
    tmp_path: Path, name: str, text: str
) -> None:
    with pytest.raises(ValueError, match=r"^[^\n]{5,150}$"):
        (json_value if name == "a.json" else toml_table)(text)
    (tmp_path / "results.json").write_text(text)
    (tmp_path / "a.toml").write_text(text)
    if name == "a.json":
        refusal(read_results, tmp_path, match=r"results\.json")
    else:
        refusal(read_study, tmp_path / name, match=r"a\.toml")


@pytest.mark.parametrize("text", ['[{"a": {"gain": 1, "b": 2, "gain": 3}}]', '{"g\\u0061in": 1, "gain": 2}'])
def test_a_key_that_stands_twice_in_an_object_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="the key 'gain' stands more than once"):
        json_value(text)


def test_sound_texts_are_read() -> None:
    assert json_value('{"a": {"b": 1}, "b": {"a": [1.5], "b": 1}}')["b"] == {"a": [1.5], "b": 1}
    assert toml_table("a.b.c = [[1, 2], [3, 4]] # ............ " + "a." * 300)["a"]["b"]["c"][1] == [3, 4]
