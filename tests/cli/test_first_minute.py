"""The first minute of somebody who has only the wheel: tour, demo, samples, help, misspelt words, completion."""

import contextlib
import json
import shlex
import tomllib
from pathlib import Path

import numpy as np
import pytest
from command_line import mrwork
from sentences import Refused

import mrwork as mr
from mrwork.cli.command_parser import examples_in
from mrwork.cli.completions import subcommands
from mrwork.cli.door import TOUR, parser, verbs
from mrwork.cli.former_words import in_words_of_today
from mrwork.records import read_test_table

# Each verb draws its page here.
pytestmark = pytest.mark.usefixtures("pages")
ROOT = Path(__file__).parent.parent.parent
PARSER = parser(verbs())
COMMANDS = subcommands(PARSER)
EXAMPLES = [(verb, line) for verb, command in COMMANDS.items() for line in examples_in(command.epilog)]
# What the examples of other verbs stand on, in the order in which a newcomer runs it.
PREPARED = (
    "mrwork identify synthetic:spencer1997 --out out/demo",
    "mrwork init rig rig",
    "mrwork init study study.toml",
    "mrwork init car car",
    "mrwork identify rig --law k_w=quadratic --law c=linear --out out/rig --quiet",
)
# Seconds each, and the code of the other example or of another test.
PARSED_ONLY = {
    "mrwork characterise rig --out out/damper",
    "mrwork characterise rig --model normalised_bouc_wen --json --out out/one-model",
    "mrwork identify synthetic:spencer1997 --model dahl,normalised_bouc_wen",
    "mrwork intervals out/demo --posterior --steps 400 --resume",
    "mrwork calibrate out/rig --leave-out motion",
    "mrwork export out/damper --target c --out damper",
    "mrwork plan out/demo",
    "mrwork fragility out/ida --limit peak_drift_ratio=1%",
    "mrwork fragility out/ida --limit peak_acceleration=3m/s2 --against uncontrolled --output limit.csv",
    "mrwork tune study.toml --law lyapunov --quick --out out/lyapunov",
    "mrwork respond study.toml --motions all --check-step --out out/checked",
}


def typed(line: str, folder: Path) -> str:
    """What a command line prints that is typed in a folder; it has to end well."""
    name, *words = shlex.split(line)
    assert name == "mrwork"
    with contextlib.chdir(folder):
        ended = mrwork(*words)
    assert ended.returncode == 0, (line, ended.stderr)
    assert "was not drawn" not in ended.stderr
    return ended.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder where a newcomer has tried what the tour shows."""
    place = tmp_path_factory.mktemp("first")
    said, *_ = [typed(line, place) for line in PREPARED]
    (place / "demo.txt").write_text(said)
    return place


# Tour and demo


def test_a_bare_call_shows_where_to_begin() -> None:
    ended = mrwork()
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, f"{TOUR}\n", "")


def test_every_command_of_the_tour_is_an_example() -> None:
    shown = [line.strip() for line in TOUR.splitlines() if line.startswith("  mrwork ")]
    assert set(shown) <= {line.removesuffix(" --quiet") for line in PREPARED} | {line for _, line in EXAMPLES}


def test_the_first_command_finds_the_parameters_that_its_test_was_made_with(folder: Path) -> None:
    assert "Report: out/demo/report.html" in (folder / "demo.txt").read_text()
    found = mr.load(folder / "out" / "demo", mr.StoredRun).fit
    assert found.fit_percent > 99.0


@pytest.mark.parametrize(
    ("earlier", "today"),
    [
        (
            "demo --quiet",
            "identify synthetic:spencer1997 --model normalised_bouc_wen --seed 1 --out out/demo --quiet",
        ),
        (
            "demo --seed 2 --out here",
            "identify synthetic:spencer1997 --model normalised_bouc_wen --seed 2 --out here",
        ),
        ("profile run --level 0.9", "intervals run --level 0.9"),
        ("sample run --steps 9", "intervals --posterior run --steps 9"),
        ("convert spencer A=1 --to opensees", "models spencer A=1 --to opensees"),
        ("cite run --json", "report --cite run --json"),
        ("completion zsh", "--completion zsh"),
        ("respond --schema", "help study"),
        ("respond study.toml --laws", "help laws"),
        ("respond study.toml --building --json", "check study.toml --json"),
        ("respond study.toml --pushover", "check study.toml --pushover"),
        ("respond study.toml --size storey --figure a.svg", "tune study.toml --size storey --figure a.svg"),
        ("respond study.toml --seed 2", "respond study.toml --seed 2"),
    ],
)
def test_earlier_words_are_taken_for_a_release_and_told(
    earlier: str, today: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert in_words_of_today(earlier.split()) == today.split()
    assert (f"is `mrwork {today}` now" in capsys.readouterr().err) is (earlier != today)


# Samples


def test_the_sample_rig_has_tests_for_every_use(tmp_path: Path) -> None:
    written = json.loads(mrwork("init", "rig", tmp_path / "rig", "--json").stdout)
    assert written["files"] == [str(path) for path in map(Path, written["files"]) if path.is_file()]
    rows = read_test_table(tmp_path / "rig" / "tests.csv")
    assert {row.use for row in rows} == {"fit", "calibration", "test"}
    assert len(rows) == len(written["files"]) - 1


def test_the_sample_car_is_a_study_on_two_kinds_of_roads(tmp_path: Path) -> None:
    written = json.loads(mrwork("init", "car", tmp_path / "car", "--json").stdout)
    assert written["files"] == [str(path) for path in map(Path, written["files"]) if path.is_file()]
    study = mr.read_study(tmp_path / "car" / "car.toml")
    assert study.building.floor_names == ("wheel", "body")
    assert [ground.is_road for ground in study.grounds] == [True, True, True]
    assert study.remarks == ()


@pytest.mark.long
def test_the_sample_wind_runs_and_warns_of_nothing(tmp_path: Path) -> None:
    printed = typed("mrwork init wind wind", tmp_path)
    study = mr.read_study(tmp_path / "wind" / "wind.toml")
    assert [motion.facts.use for motion in study.motions] == ["test", "test", "training"]
    assert study.remarks == ()
    weight = 9.81 * study.building.total_mass
    for ground in study.grounds:
        # A wind of a few per cent of the weight: it rises from rest, its mean grows over the height.
        assert 0.01 < ground.peak_force / weight < 0.1
        assert not ground.forces[:, 0].any()
        assert (np.diff(ground.forces[:, 50:].mean(axis=1)) > 0.0).all()
        assert 0.1 < (ground.forces[:, 50:].std(axis=1) / ground.forces[:, 50:].mean(axis=1)).min() < 0.3
    following = [line.strip() for line in printed.splitlines() if line.startswith("  mrwork ")]
    said = typed(following[0], tmp_path)
    assert "warning" not in said
    assert "Acc. roof [m/s2]" in said


@pytest.mark.long
def test_the_next_commands_of_the_rig_run_as_they_are_printed(tmp_path: Path) -> None:
    printed = typed("mrwork init rig 'a folder/my rig'", tmp_path)
    following = [line.strip() for line in printed.splitlines() if line.startswith("  mrwork ")]
    assert [line.split()[1] for line in following] == ["check", "identify", "calibrate", "predict"]
    said = [typed(line, tmp_path) for line in following]
    assert "warning" not in "".join(said)


def test_the_model_of_the_rig_predicts_its_test_rows_inside_the_bands(folder: Path) -> None:
    typed("mrwork calibrate out/rig rig", folder)
    predicted = json.loads(typed("mrwork predict out/rig rig --level 0.9 --json", folder))
    for file in predicted["files"]:
        assert file["fit_percent"] > 97.0
        assert file["coverage_percent"] > 75.0


def test_a_sample_replaces_nothing(tmp_path: Path, refused: Refused) -> None:
    rig, study, link = tmp_path / "rig", tmp_path / "study.toml", tmp_path / "link.toml"
    rig.mkdir()
    (rig / "notes.txt").write_text("mine")
    study.write_text("mine")
    link.symlink_to(tmp_path / "nowhere")
    for words in (("rig", rig), ("rig", study), ("study", study), ("study", link)):
        refused.command("init", *words)
    assert [path.name for path in rig.iterdir()] == ["notes.txt"]
    assert study.read_text() == "mine"
    assert not (tmp_path / "nowhere").exists()


def test_what_the_samples_are_made_of_is_packed_into_a_wheel() -> None:
    packed = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["maturin"]["include"]
    found = {path.name for each in packed for path in ROOT.glob(each["path"]) if "wheel" in each["format"]}
    assert "study.toml" in found


# Help and examples


def test_every_verb_has_two_examples() -> None:
    assert all(len(examples_in(COMMANDS[verb].epilog)) >= 2 for verb in verbs())


@pytest.mark.long
@pytest.mark.parametrize(("verb", "line"), EXAMPLES, ids=lambda each: each)
def test_an_example_runs_as_it_is_typed(verb: str, line: str, folder: Path) -> None:
    name, *words = shlex.split(line)
    assert (name, words[0]) == ("mrwork", verb)
    PARSER.parse_args(words)
    if line not in PARSED_ONLY and line not in [each.removesuffix(" --quiet") for each in PREPARED]:
        typed(line, folder)


# Misspelt words


MISSPELT = [
    ("identfy", "f.csv"),
    ("--json",),
    ("identify", "--modle=bouc_wen"),
    ("identify", "f.csv", "-q"),
    ("report", "out", "figures"),
    ("calibrate", "out", "--threads", "1", "f.csv"),
    ("identify", "synthetic:spencer1997", "--search", "rase"),
    ("identify", "synthetic:spencer1997", "--model", "bingham,bouc_wem"),
    ("identify", "synthetic:spencr1997"),
    ("identify", "synthetic:spencer1997", "--law", "k_w=quadratc"),
    ("identify", "synthetic:spencer1997", "--law", "kw=quadratic"),
    ("identify", "synthetic:spencer1997", "--bound", "sgma=1:2"),
    ("identify", "synthetic:spencer1997", "--repair", "ofset"),
    ("identify", "synthetic:spencer1997", "--observe", "averge=1"),
    ("check", "f.csv", "--column", "forc=F:kN"),
    ("models", "bouc_wem"),
    ("models", "spencer", "alpa=1", "--to", "normalised"),
    ("init", "rigg", "here"),
]


@pytest.mark.parametrize("words", MISSPELT, ids=" ".join)
def test_a_misspelt_word_is_one_sentence_that_names_the_nearest(
    words: tuple[str, ...], refused: Refused
) -> None:
    refused.command(*words)


# Completion


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_completion_has_every_verb_and_option_and_the_names(shell: str) -> None:
    script = mrwork("--completion", shell).stdout
    for verb, command in COMMANDS.items():
        assert verb in script
        for option in command._option_string_actions:
            assert option.lstrip("-") in script, (verb, option)
    for name in [
        "normalised_modified_bouc_wen",
        "k_w=quadratic",
        "differential_evolution",
        "clipped_optimal",
    ]:
        assert name in script
