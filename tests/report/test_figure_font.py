"""Figures look the same on every machine: one font, shipped with matplotlib, for measuring and drawing.

`python tests/report/test_figure_font.py` makes the subsets that pages embed.
"""

import io
import os
import sys
from pathlib import Path

from command_line import ran
from fontTools import subset
from fontTools.ttLib import TTFont
from report_samples import prediction

from mrwork.plots import style
from mrwork.plots.canvas import inline_svg
from mrwork.report.fit.figures import history_figure

# ASCII, Latin with accents, Greek, and the punctuation and mathematical signs of labels.
_CHARACTERS = (
    *(range(0x20, 0x7F), range(0xA0, 0x100), range(0x391, 0x3CA), range(0x2070, 0x208F)),
    [ord(sign) for sign in "\u2002\u2007\u2009\u202f–—‘’“”•…′″←→∂∆∈−∙√∝∞∫≈≠≤≥"],
)
_SUBSETS = Path(str(style.__file__)).parent
# Copyright, licence and its address stay in the file.
_KEPT_NAMES = [0, 1, 2, 3, 4, 5, 6, 13, 14]

_DRAW = """
import sys, hashlib
from report_samples import prediction
from mrwork.report.fit.figures import history_figure
from mrwork.plots import style
from mrwork.plots.canvas import inline_svg, svg_bytes
with style.drawn_in_style():
    figure = history_figure(prediction(), "N")
print(hashlib.sha256(svg_bytes(figure) + inline_svg(figure, identifier="f", description="").encode()).hexdigest())
"""


def test_fonts_of_the_system_change_no_figure_and_a_page_brings_its_own(tmp_path: Path) -> None:
    """A system with another DejaVu Sans, preferred by its list of fonts, and one without any."""
    drawn = set()
    for number, extra in enumerate(("", "font_manager.fontManager.ttflist.clear();")):
        prepare = f"from matplotlib import font_manager; {extra}\n"
        environment = os.environ | {
            "MPLCONFIGDIR": str(tmp_path / str(number)),
            "PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[1] / "samples"), *sys.path]),
        }
        drawn.add(ran(sys.executable, "-c", prepare + _DRAW, env=environment, check=True).stdout)
    assert len(drawn) == 1
    with style.drawn_in_style():
        text = inline_svg(history_figure(prediction(), "N"), identifier="f", description="")
    assert style.FAMILY in text
    assert "DejaVu" not in text
    assert style.font_faces().count("data:font/woff;base64,") == 2
    for weight in (400, 700):
        whole, part = TTFont(style.path_of(weight)), TTFont(_SUBSETS / style.subset_name(weight))
        names, kept = whole.getBestCmap(), part.getBestCmap()
        expected = {code for characters in _CHARACTERS for code in characters} & names.keys()
        assert kept.keys() >= expected
        assert all(part["hmtx"][kept[code]] == whole["hmtx"][names[code]] for code in expected)


def write_subsets() -> None:
    for weight in (400, 700):
        options = subset.Options(
            flavor="woff", layout_features=["kern"], hinting=False, name_IDs=_KEPT_NAMES, notdef_outline=True
        )
        options.drop_tables = [*options.drop_tables, "FFTM"]
        file = subset.load_font(io.BytesIO(style.path_of(weight).read_bytes()), options)
        subsetter = subset.Subsetter(options)
        subsetter.populate(unicodes=[code for characters in _CHARACTERS for code in characters])
        subsetter.subset(file)
        subset.save_font(file, _SUBSETS / style.subset_name(weight), options)


if __name__ == "__main__":
    write_subsets()
