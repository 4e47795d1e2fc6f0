"""What `mrwork report --cite` prints: every published source is a work with a title, and every work has a use."""

import json
import re
from pathlib import Path

from command_line import mrwork, printed

import mrwork as mr
from mrwork import buildings, control
from mrwork.dampers.spec import published_sets  # of all models at once
from mrwork.runs.citations import references_in, references_of
from mrwork.search.registry import ALL_OPTIMISERS  # with those that other libraries bring

SOURCES = {
    each.name: each.source
    for registry in (mr.damper_models(), published_sets(), control.control_laws(), buildings.buildings())
    for each in registry
}
# Papers of which only the place is known: they are cited in the words of the source.
UNTITLED = {"maxwell", "orifice"}


def test_a_published_source_names_a_work_with_a_title_and_every_search_has_one() -> None:
    published = [name for name, source in SOURCES.items() if re.search(r"\d{4}\b", source)]
    assert len(published) > 20
    for name in published:
        works = references_in(SOURCES[name], name)
        assert works, name
        assert all(("title" in work.fields) == (name not in UNTITLED) for work in works), name
    assert all(references_of(name) for name in ALL_OPTIMISERS)


def test_a_source_of_ones_own_is_cited_in_its_words() -> None:
    (work,) = references_in("Smith & Jones, our rig, 2024", "my rig")
    assert work.bibtex == "@misc{my-rig,\n  note = {Smith \\& Jones, our rig, 2024},\n}"
    assert references_in("our definition", "mine") == ()


def test_braces_of_all_entries_balance() -> None:
    works = {work.key: work for source in SOURCES.values() for work in references_in(source, "x")}
    assert len(works) > 20
    for work in works.values():
        assert work.bibtex.count("{") == work.bibtex.count("}")
        assert {"year"} <= set(work.fields) or work.kind == "misc"


def test_a_run_cites_its_model_its_search_and_its_records(tmp_path: Path) -> None:
    test = mr.synthetic_test("spencer1997")
    rows = zip(test.time, test.displacement, test.force, strict=True)
    record = tmp_path / "rig_50%.csv"
    record.write_text(
        "time_s,displacement_m,force_N\n" + "".join(f"{t:.4f},{x:.7g},{f:.6g}\n" for t, x, f in rows)
    )
    place = tmp_path / "run"
    printed(
        "identify", record, "--model", "bingham", "--search", "particle_swarm", "--generations", 2, "--column",
        "command=0A", "--quiet", "--out", place,
    )  # fmt: skip
    entries = json.loads(mrwork("report", place, "--cite", "--json").stdout)["entries"]
    used_for = {entry["key"]: entry["used_for"] for entry in entries}
    assert used_for["stanway1987"] == ["model: bingham"]
    assert used_for["kennedy1995"] == ["method: particle_swarm"]
    assert [entry["fields"]["title"] for entry in entries if entry["key"].startswith("record-")] == [
        r"rig\_50\%.csv"
    ]
