"""The clean test under odd headings and in odd units."""

import io
import zipfile
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
import pytest
from record_files import DT, clean_columns

from mrwork.records import DamperTest

COLUMNS = clean_columns()
TIME, MM, NEWTON = COLUMNS["t_s"], 1e3 * COLUMNS["displacement_m"], COLUMNS["force_n"]
KN = 1e-3 * NEWTON


def write_table(
    path: Path, columns: Mapping[str, Sequence[object]], *units: str, delimiter: str = "\t"
) -> Path:
    """Columns below their headings, and below a row of units where these are given."""
    lines = [delimiter.join(columns), *([delimiter.join(units)] if units else [])]
    lines += [delimiter.join(str(cell) for cell in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(lines) + "\n")
    return path


def assert_is_the_test(test: DamperTest) -> None:
    """The clean test, whatever its units were."""
    assert test.dt == pytest.approx(DT, rel=1e-6)
    np.testing.assert_allclose(test.displacement, COLUMNS["displacement_m"], rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(test.force, COLUMNS["force_n"], rtol=1e-8, atol=1e-8)


# A serial number of a spreadsheet counts days from here.
_DAY_ZERO = datetime(1899, 12, 30)
_OFFICE = "http://schemas.openxmlformats.org"
_MAIN = f"{_OFFICE}/spreadsheetml/2006/main"
_RELATIONS = f"{_OFFICE}/package/2006/relationships"
_DOCUMENT = f"{_OFFICE}/officeDocument/2006/relationships"
_TYPES = (
    f'<Types xmlns="{_OFFICE}/package/2006/content-types"><Default Extension="rels" ContentType="application/'
    'vnd.openxmlformats-package.relationships+xml"/><Default Extension="xml" ContentType="application/xml"/>'
    '<Override PartName="/xl/workbook.xml" ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml'
    '.sheet.main+xml"/></Types>'
)
# The second style is that of dates.
_STYLES = (
    f'<styleSheet xmlns="{_MAIN}"><numFmts count="1"><numFmt numFmtId="164" formatCode="yyyy-mm-dd hh:mm:ss.000"/>'
    '</numFmts><cellXfs count="2"><xf numFmtId="0"/><xf numFmtId="164"/></cellXfs></styleSheet>'
)


def workbook(sheets: Mapping[str, Sequence[Sequence[object]]]) -> bytes:
    """An .xlsx workbook; cells are texts, numbers, times, or `None`."""
    names = list(enumerate(sheets, start=1))
    listed = "".join(f'<sheet name="{escape(name)}" sheetId="{k}" r:id="r{k}"/>' for k, name in names)
    related = "".join(
        f'<Relationship Id="r{k}" Type="{_DOCUMENT}/worksheet" Target="worksheets/sheet{k}.xml"/>'
        for k, _ in names
    )
    parts = {
        "[Content_Types].xml": _TYPES,
        "_rels/.rels": f'<Relationships xmlns="{_RELATIONS}"><Relationship Id="r1" Type="{_DOCUMENT}/officeDocument" '
        'Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{_MAIN}" xmlns:r="{_DOCUMENT}"><sheets>{listed}</sheets></workbook>',
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{_RELATIONS}">{related}<Relationship Id="r0" '
        f'Type="{_DOCUMENT}/styles" Target="styles.xml"/></Relationships>',
        "xl/styles.xml": _STYLES,
    }
    for k, name in names:
        rows = "".join(
            f'<row r="{number}">{"".join(_cell(cell, number, place) for place, cell in enumerate(row))}</row>'
            for number, row in enumerate(sheets[name], start=1)
        )
        parts[f"xl/worksheets/sheet{k}.xml"] = (
            f'<worksheet xmlns="{_MAIN}"><sheetData>{rows}</sheetData></worksheet>'
        )
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as file:
        for part, text in parts.items():
            # Always of one time, so that the bytes are the same.
            file.writestr(zipfile.ZipInfo(part), f'<?xml version="1.0"?>{text}', zipfile.ZIP_DEFLATED)
    return content.getvalue()


def _cell(cell: object, row: int, place: int) -> str:
    where = f'r="{chr(ord("A") + place)}{row}"'
    if cell is None:
        return ""
    if isinstance(cell, str):
        return f'<c {where} t="inlineStr"><is><t>{escape(cell)}</t></is></c>'
    if isinstance(cell, datetime):
        return f'<c {where} s="1"><v>{(cell - _DAY_ZERO).total_seconds() / 86400.0!r}</v></c>'
    return f"<c {where}><v>{float(cell)!r}</v></c>"  # type: ignore[arg-type] # a cell that is no text is a number
