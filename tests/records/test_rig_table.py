"""A table of tests says what each file is; a first guess of it is written, with what is in doubt."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import mrwork
from record_files import clean_columns, write_text
from refusals import command_refusal, refusal
from sentences import Refused

import mrwork as mr
from mrwork.identification.fit_file import read_fit, reopen
from mrwork.records.columns import parse_column_option
from mrwork.records.rig_table import listed_tests

HEADER = "file,use,time,displacement,force,velocity,command,doubt"


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    """A folder of three records, one of them with columns that cannot be told by name."""
    folder = tmp_path / "rig"
    folder.mkdir()
    columns = clean_columns()
    write_text(folder / "10mm2Hz0x5A.csv", columns)
    # Twice as fast, so that bands may be calibrated on it.
    faster = {**columns, "t_s": 0.5 * columns["t_s"], "velocity_mps": 2.0 * columns["velocity_mps"]}
    write_text(folder / "run_7_500mA.csv", faster)
    unnamed = dict(zip(("a", "b", "c", "d"), columns.values(), strict=True))
    write_text(folder / "z.csv", unnamed)
    return folder


def table(folder: Path, *lines: str, name: str = "tests.csv", header: str = HEADER) -> Path:
    path = folder / name
    path.write_text("\n".join([header, *lines]) + "\n")
    return path


FULL = (
    "10mm2Hz0x5A.csv,fit,,,,,,",
    "run_7_500mA.csv,calibration,,,,,1.5 A,",
    "z.csv,test,a:s,b:m,d:N,c:m/s,0.2 A,checked",
)


def test_a_table_gives_columns_units_and_commands_and_selects_by_use(rig: Path) -> None:
    path = table(rig, *FULL)
    tests = mr.read_damper_tests(path)
    assert [(test.name, test.current) for test in tests] == [
        ("10mm2Hz0x5A", 0.5),
        ("run_7_500mA", 1.5),
        ("z", 0.2),
    ]
    for test in tests:
        np.testing.assert_array_equal(test.force, clean_columns()["force_n"])
    for use, name in (("fit", "10mm2Hz0x5A"), ("calibration", "run_7_500mA"), ("test", "z")):
        (test,) = mr.read_damper_tests(rig, use=use)  # type: ignore[arg-type] # the folder stands for its table
        assert test.name == name


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_a_table_may_come_from_a_spreadsheet(rig: Path, delimiter: str) -> None:
    path = table(rig, *FULL)
    text = path.read_text().replace(",", delimiter).replace("0.2 A", "0,2 A")
    path.write_bytes(("\N{ZERO WIDTH NO-BREAK SPACE}" + text.replace("\n", delimiter + "\r\n")).encode())
    assert [test.current for test in mr.read_damper_tests(path)] == [0.5, 1.5, 0.2]


def test_a_command_is_a_number_or_a_column_and_goes_before_those_of_the_record(tmp_path: Path) -> None:
    columns = clean_columns()
    columns["current_a"] = np.full(columns["t_s"].size, 0.5)
    columns["drive"] = np.full(columns["t_s"].size, 700.0)
    path = write_text(tmp_path / "rig.csv", columns)
    assert mr.read_damper_test(path).current == 0.5
    assert mr.read_damper_test(path, columns={"command": "drive:mA"}).current == pytest.approx(0.7)
    columns["Amplifier, V"] = columns.pop("drive")
    path = write_text(tmp_path / "rig.csv", columns, ";")
    assert mr.read_damper_test(path, columns={"command": "Amplifier, V"}).voltage == 700.0
    assert parse_column_option("command=0.5A") == ("command", "0.5A")


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("force_n", "'force_n' of the command does not say its unit"),
        ("0.5", "such as 0.5 A, or COLUMN:UNIT"),
        ("valve:turns", "'turns' is no unit of a command"),
        ("1e9 %", r"more than 1e\+06 %"),
    ],
)
def test_a_wrong_command_is_refused(rig: Path, text: str, word: str) -> None:
    refusal(mr.read_damper_test, rig / "10mm2Hz0x5A.csv", columns={"command": text}, match=word)


def test_a_folder_without_a_table_stands_for_its_records(rig: Path) -> None:
    (rig / "z.csv").unlink()
    (rig / "notes.md").write_text("not a record")
    (rig / ".hidden.csv").write_text("x")
    assert [test.name for test in mr.read_damper_tests(rig)] == ["10mm2Hz0x5A", "run_7_500mA"]
    refusal(listed_tests, [rig, rig / "10mm2Hz0x5A.csv"], use="fit", match="10mm2Hz0x5A.csv is given 2 times")


@pytest.mark.parametrize(
    ("lines", "word"),
    [
        (("a.csv,fit,t:s,,,,",), "line 2: has 7 entries where the header names 8"),
        (("a.csv,fitting,,,,,,",), "did you mean fit"),
        (("a.csv,fit,,,F:?,,,",), "line 2: the force of 'a.csv' is 'F:[?]'"),
        (("a.csv,fit,,,,,,", "# later", "a.csv,test,,,,,,"), "line 4: 'a.csv' is in the table twice"),
        (("absent.csv,fit,,,,,,",), "absent.csv: there is no such file"),
    ],
)
def test_a_wrong_table_is_refused_by_its_line(tmp_path: Path, lines: tuple[str, ...], word: str) -> None:
    refusal(mr.read_damper_tests, table(tmp_path, *lines), match=word)


def test_a_wrong_header_of_a_table_is_refused(tmp_path: Path) -> None:
    wrong = table(tmp_path, "a.csv,fit,x", header="file,use,colour")
    refusal(mr.read_damper_tests, wrong, match="line 1: .*'colour'")


def test_a_folder_with_no_record_and_a_use_with_no_test_are_refused(
    rig: Path, tmp_path: Path, refused: Refused
) -> None:
    (tmp_path / "empty").mkdir()
    refused(mr.read_damper_tests, tmp_path / "empty")
    table(rig, *FULL[:1])
    refused(mr.read_damper_tests, rig, use="calibration")


def test_a_pattern_that_takes_in_table_and_records_is_refused(rig: Path) -> None:
    table(rig, *FULL)
    refusal(mr.read_damper_tests, str(rig / "*.csv"), match="is given 2 times; give its table of tests")


def test_the_first_guess_says_what_is_in_doubt(rig: Path) -> None:
    (rig / "broken.csv").write_bytes(bytes(range(256)))
    named, loose, unknown, broken = mr.records.guess_tests(
        [rig / name for name in ("10mm2Hz0x5A.csv", "run_7_500mA.csv", "z.csv", "broken.csv")]
    )
    assert named == mr.records.ListedTest(
        file=str(rig / "10mm2Hz0x5A.csv"),
        use="fit",
        columns={
            "time": "t_s:s",
            "displacement": "displacement_m:m",
            "force": "force_n:N",
            "velocity": "velocity_mps:m/s",
            "command": "0.5 A",
        },
    )
    assert loose.columns["command"] == "0.5 A"
    assert loose.doubt == "the command is guessed from the name of the file"
    assert [unknown.columns[key] for key in ("time", "displacement", "force")] == ["?", "?", "?"]
    assert "no column for the force among 'a', 'b', 'c', 'd'" in unknown.doubt
    assert "the command is not known" in unknown.doubt
    assert (broken.use, broken.columns) == (None, {})
    assert "binary" in broken.doubt


def test_a_guess_is_written_once_and_read_back(rig: Path) -> None:
    rows = mr.records.guess_tests([rig / "10mm2Hz0x5A.csv"])
    path = rig / "tests.csv"
    mr.records.write_test_table(path, rows)
    assert mr.records.read_test_table(path) == rows
    assert "10mm2Hz0x5A.csv,fit" in path.read_text()
    refusal(mr.records.write_test_table, path, rows, match="there already")


def test_a_name_with_delimiters_survives_the_table(tmp_path: Path) -> None:
    columns = clean_columns()
    odd = {"Position(Linear:Digital), 'x' (m)": columns["displacement_m"], **columns}
    del odd["displacement_m"]
    path = tmp_path / "a; b, c.csv"
    write_text(path, odd, "\t")
    mr.records.write_test_table(tmp_path / "tests.csv", mr.records.guess_tests([path]))
    (test,) = mr.read_damper_tests(tmp_path)
    np.testing.assert_array_equal(test.displacement, columns["displacement_m"])


def test_the_command_line_goes_from_a_folder_to_a_table_to_a_fit_that_opens_again(rig: Path) -> None:
    guessed = mrwork("check", rig, "--table", "--json")
    document = json.loads(guessed.stdout)
    assert document["table"] == str(rig / "tests.csv")
    assert [bool(row["doubt"]) for row in document["tests"]] == [False, True, True]
    # What is not known stays a question until it is answered.
    question = "line 4: the time of 'z.csv' is '[?]'"
    command_refusal("identify", rig, "--model", "bingham", "--out", rig / "run", match=question)
    table(rig, *FULL)
    place = rig.parent / "run"
    fitted = mrwork("identify", rig, "--model", "bingham", "--out", place, "--json", "--every", "2")
    assert [each["test"] for each in json.loads(fitted.stdout)["files"]] == ["10mm2Hz0x5A"]
    reading = read_fit(place).reading()
    assert reading.files == (str(rig / "10mm2Hz0x5A.csv"),)
    predicted = mrwork("predict", place, rig / "tests.csv", "--json")
    assert [Path(each["file"]).name for each in json.loads(predicted.stdout)["files"]] == ["z.csv"]
    calibrated = mrwork("calibrate", place, rig, "--json")
    assert json.loads(calibrated.stdout)["tests"] == [str(rig / "run_7_500mA.csv")]
    checked = mrwork("check", rig, "--json")
    assert len(json.loads(checked.stdout)["files"]) == 3
    # The fit keeps what the table said, whatever becomes of the table.
    (rig / "tests.csv").unlink()
    assert reopen(place).tests[0].current == 0.5


def test_a_fit_keeps_the_columns_that_a_table_gave(rig: Path) -> None:
    table(rig, FULL[2].replace(",test,", ",fit,"))
    place = rig.parent / "run"
    assert mrwork("identify", rig, "--model", "bingham", "--out", place, "--quiet").returncode == 0
    assert read_fit(place).reading().columns_of[str(rig / "z.csv")]["force"] == "d:N"
    assert reopen(place).tests[0].current == 0.2


def test_check_reads_a_folder_and_says_each_refusal_once(rig: Path) -> None:
    (rig / "damaged.mat").write_bytes(b"MATLAB 5.0")
    ended = mrwork("check", rig, "--json")
    errors = {Path(row["file"]).name: row.get("error", "") for row in json.loads(ended.stdout)["files"]}
    assert (ended.returncode, len(ended.stderr.splitlines())) == (2, 2)
    assert {name for name, error in errors.items() if error} == {"damaged.mat", "z.csv"}
    # The options of one file are for every file, and the others have other columns.
    assert "into its row of a table of tests, as mrwork check FILES --table begins it" in ended.stderr


@pytest.mark.parametrize("paths", ["", [""]])
def test_an_empty_name_is_not_the_current_folder(
    rig: Path, monkeypatch: pytest.MonkeyPatch, paths: str | list[str]
) -> None:
    monkeypatch.chdir(rig)
    refusal(mr.read_damper_tests, paths, match="no file matches|no record given")
