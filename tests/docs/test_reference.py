"""The generated reference has everything that can be used, and its text is complete before Sphinx sees it."""

import re
from pathlib import Path

import pytest

import mrwork as mr
from generate.api_pages import described_names, namespaces
from generate.equations import tex
from generate.markdown import prose
from generate.pages import REFERENCE, STUDIES, pages, pictures
from generate.study_pages import readme
from mrwork.base.documents import keys_in_words
from mrwork.base.keys import tables
from mrwork.cli.door import parser, verbs
from mrwork.control.laws.law_settings import SETTINGS
from mrwork.study.schema import StudyTable


@pytest.fixture(scope="module")
def texts() -> dict[Path, str]:
    return pages()


def page(texts: dict[Path, str], folder: str, name: str) -> str:
    return texts[REFERENCE / folder / f"{name}.md"]


def test_every_verb_has_a_page_with_its_options(texts):
    for verb in verbs():
        text = page(texts, "verbs", verb)
        choices = next(each.choices for each in parser([verb])._actions if isinstance(each.choices, dict))
        for action in choices[verb]._actions:
            names = action.option_strings or [str(action.metavar)]
            assert action.dest == "help" or f"{{option}} {names[0]}" in text
        assert "130" in text


def test_every_key_of_a_study_is_in_the_schema(texts):
    text = texts[REFERENCE / "schema.md"]
    for heading, kind in tables(StudyTable):
        section = text.partition(f"## {f'`{heading}`' if heading else 'At the top'}\n")[2].partition("\n## ")[
            0
        ]
        for key in keys_in_words(kind):
            assert f"| `{key.name}` |" in section


def test_every_model_has_a_page_with_its_parameters_sets_and_loop(texts):
    for spec in mr.damper_models():
        text = page(texts, "models", spec.name)
        assert prose(spec.source) in text
        assert [name for name in (*spec.names, *spec.presets) if f"`{name}`" not in text] == []
        assert REFERENCE / "figures" / f"{spec.name}.svg" in pictures()


def test_every_law_has_a_page_with_its_settings_and_gains(texts):
    for spec in mr.control.control_laws():
        text = page(texts, "laws", spec.name)
        names = [
            *(key.name for key in keys_in_words(SETTINGS[spec.name])),
            *(gain.name for gain in spec.gains),
        ]
        assert [name for name in names if f"`{name}`" not in text] == []


def test_every_public_name_is_listed_and_described_once(texts):
    listed = {f"{each.path}.{name.name}" for each in namespaces() for name in each.names}
    assert {f"mrwork.{name}" for name in ("identify", "control.design_law", "dampers.design.Slot")} <= listed
    for namespace in namespaces():
        text = page(texts, "api", namespace.path)
        for name in namespace.names:
            assert f"[`{name.name}`]({name.page}.md)" in text
            assert name.full in page(texts, "api", name.page)
    assert "mrwork.closed_loop.SCORE" not in described_names().values()
    paths = [str(path).lower() for path in texts]
    assert len(paths) == len(set(paths)), "names that differ in case only share a file on some systems"


def test_every_study_is_included(texts):
    root = Path(__file__).parents[2] / "studies"
    names = {path.parent.name for path in root.glob("*/README.md")}
    names |= {path.stem for path in root.glob("*.py")} - {"common", "timing"}
    assert {path.stem for path in texts if path.parent == STUDIES} == names | {"index"}


def test_the_table_of_studies_has_all_scripts():
    written = (Path(__file__).parents[2] / "studies" / "README.md").read_text(encoding="utf-8")
    assert written == readme(), "in docs: python -m generate.study_pages > ../studies/README.md"


def test_every_link_of_a_page_leads_to_a_page(texts):
    written = Path(__file__).parents[2] / "docs"
    for path, text in texts.items():
        for link in re.findall(r"\]\(([^)#]+\.md)", text):
            target = (written / path.parent / link).resolve().relative_to(written.resolve())
            assert target in texts, f"{path} links to {link}"


@pytest.mark.parametrize(
    ("equation", "expected"),
    [
        ("f = c0 v + k_w w", r"f = c_{0}\,v + k_{w}\,w"),
        ("z' = -gamma |v| z |z|^(n-1)", r"z^{\prime} = -\gamma \,\left|v\right|\,z\,\left|z\right|^{n-1}"),
        ("i = i_max H(e), no i", r"i = i_{\mathrm{max}}\,H(e),\;\text{ no }i"),
    ],
)
def test_an_equation_becomes_tex(equation, expected):
    assert re.sub(r"\s*\}$", "}", tex(equation)) == expected
