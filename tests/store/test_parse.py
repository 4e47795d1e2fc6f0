"""JSON and TOML that would exhaust the parser or the program are refused in a phrase."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from mrwork.buildings import read_building
from mrwork.errors import MrworkError
from mrwork.store.input_file import json_value, toml_table
from mrwork.study import read_results, read_study

DEEP_JSON = ["[" * n + "]" * n for n in (200, 3_000, 100_000)] + ['{"a":' * 3_000 + "1" + "}" * 3_000]
DEEP_TOML = [
    "x = " + "[" * 200 + "]" * 200,
    "x = " + "[" * 50_000 + "]" * 50_000,
    "x = " + "{a = " * 5_000 + "1" + "}" * 5_000,
    "a." * 20_000 + "a = 1",
    "x = 1\n[" + '"a" . ' * 20_000 + "a]",
    "x = {" + "a." * 20_000 + "a = 1}",
]
LONG_NUMBERS = ["1" * 400, "-" + "1" * 400, "1" * 5_000]


@pytest.mark.parametrize("text", DEEP_JSON + LONG_NUMBERS + ["[NaN]", "-Infinity", "", "{"])
def test_json_is_refused_in_a_phrase(text: str) -> None:
    with pytest.raises(ValueError, match=r"^[^\n]{5,150}$"):
        json_value(text)


@pytest.mark.parametrize("text", DEEP_TOML + [f"x = {digits}" for digits in LONG_NUMBERS])
def test_toml_is_refused_in_a_phrase(text: str) -> None:
    with pytest.raises(ValueError, match=r"^[^\n]{5,150}$"):
        toml_table(text)


@pytest.mark.parametrize(
    "text",
    ['{"gain": 1, "gain": 1}', '[{"a": {"gain": 1, "b": 2, "gain": 3}}]', '{"g\\u0061in": 1, "gain": 2}'],
)
def test_a_key_that_stands_twice_in_an_object_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="the key 'gain' stands more than once"):
        json_value(text)


def test_sound_texts_are_read() -> None:
    assert json_value('{"a": {"b": 1}, "b": {"a": 1, "b": 1}}')["b"] == {"a": 1, "b": 1}
    assert json_value('{"a": [1.5, 115792089237316195423570985008687907853]}')["a"][0] == 1.5
    assert toml_table("a.b.c = [[1, 2], [3, 4]] # ............ " + "a." * 300)["a"]["b"]["c"][1] == [3, 4]


@pytest.mark.parametrize("text", [*DEEP_TOML, "x = " + "1" * 400, "[building]\nn_storeys = " + "1" * 400])
@pytest.mark.parametrize("read", [read_study, read_building])
def test_readers_of_toml_refuse_it_by_the_name_of_the_file(
    tmp_path: Path, text: str, read: Callable[[Path], object]
) -> None:
    path = tmp_path / "frame.toml"
    path.write_text(text)
    with pytest.raises(MrworkError, match=r"frame\.toml"):
        read(path)


@pytest.mark.parametrize("text", [*DEEP_JSON, '{"title": ' + "1" * 400 + "}"])
def test_readers_of_json_refuse_it_by_the_name_of_the_file(tmp_path: Path, text: str) -> None:
    (tmp_path / "results.json").write_text(text)
    with pytest.raises(MrworkError, match=r"results\.json"):
        read_results(tmp_path)
