"""A renderer of matplotlib for figures inside a page: short SVG, with text in the font that the page embeds.

Matplotlib's own renderer writes files for any program: a group and a name for every artist, six decimals, and fonts
that it looks up anew for every figure. A page of many figures spends most of its time there.
"""

from __future__ import annotations

import base64
import io
from functools import lru_cache
from html import escape
from typing import Literal, cast

import numpy as np
from matplotlib.backend_bases import FigureCanvasBase, GraphicsContextBase, RendererBase
from matplotlib.colors import to_hex, to_rgba
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.image import imsave
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.textpath import text_to_path
from matplotlib.transforms import Affine2D, Affine2DBase, Transform
from matplotlib.typing import ColorType
from numpy.typing import ArrayLike, NDArray

from mrwork.escaping import escaped_lines
from mrwork.report import style
from mrwork.report.single_tick import single_ticks

# Of figures while they are drawn: a unit of the SVG is a point.
_DOTS_PER_INCH = 72.0
# Red, green, blue and opacity.
_Colour = tuple[float, float, float, float]

# Pixels of an image per point.
_IMAGE_SCALE = 2.0

_ANCHORS = {"left": "start", "center": "middle", "right": "end"}
_CAPS = {"butt": "butt", "round": "round", "projecting": "square"}
_WEIGHTS = {"normal": 400, "regular": 400, "bold": 700}
# How a segment of a path begins, and how many more vertices it has.
_SEGMENTS = {
    int(Path.STOP): ("", 0),
    int(Path.MOVETO): ("M%.2f %.2f", 0),
    int(Path.LINETO): ("L%.2f %.2f", 0),
    int(Path.CURVE3): ("Q%.2f %.2f", 1),
    int(Path.CURVE4): ("C%.2f %.2f", 2),
    int(Path.CLOSEPOLY): ("z", 0),
}


@style.drawn_in_style()
def drawn_for_page(figure: Figure, identifier: str) -> SvgRenderer:
    """A figure as elements whose names begin with `identifier`."""
    canvas, dots_per_inch = figure.canvas, figure.get_dpi()
    figure.set_dpi(_DOTS_PER_INCH)
    width, height = (_DOTS_PER_INCH * figure.get_size_inches()).tolist()
    renderer = SvgRenderer(width, height, identifier)
    _Canvas(figure, renderer)
    try:
        with single_ticks(figure):
            figure.draw(renderer)
    finally:
        figure.set_canvas(canvas)
        figure.set_dpi(dots_per_inch)
    return renderer


class _Canvas(FigureCanvasBase):
    """Lets a figure that lays itself out measure its texts with the renderer that draws them."""

    def __init__(self, figure: Figure, renderer: SvgRenderer) -> None:
        super().__init__(figure)
        self._renderer = renderer

    def get_renderer(self) -> SvgRenderer:
        """The renderer."""
        return self._renderer


class SvgRenderer(RendererBase):
    """Writes what is drawn as elements of an SVG of this size [pt]; names of elements begin with `identifier`."""

    def __init__(self, width: float, height: float, identifier: str) -> None:
        super().__init__()
        self.width, self.height = width, height
        self._identifier = identifier
        self._elements: list[str] = []
        self._names: dict[str, str] = {}
        self._up = Affine2D().scale(1.0, -1.0).translate(0.0, height)

    @property
    def body(self) -> str:
        """The elements."""
        return "".join(self._elements)

    def draw_path(
        self, gc: GraphicsContextBase, path: Path, transform: Transform, rgbFace: ColorType | None = None
    ) -> None:
        """A line, or an area with its edge."""
        is_line = rgbFace is None
        clip = (0.0, 0.0, self.width, self.height) if is_line else None
        simplify = is_line and path.should_simplify
        data = _data(path.cleaned(transform + self._up, True, clip, simplify=simplify, curves=True))
        if data:
            self._elements.append(f'<path d="{data}"{_paint(gc, rgbFace)}{self._clip(gc)}/>')

    def draw_markers(
        self,
        gc: GraphicsContextBase,
        marker_path: Path,
        marker_trans: Transform,
        path: Path,
        trans: Transform,
        rgbFace: ColorType | None = None,
    ) -> None:
        """A mark at each vertex."""
        mark = marker_path.cleaned(marker_trans + Affine2D().scale(1.0, -1.0), simplify=False, curves=True)
        name = self._named(f'<path id="{{}}" d="{_data(mark)}"/>')
        # What lies outside of the figure by more than itself is not drawn.
        clip = (-self.width, -self.height, 2.0 * self.width, 2.0 * self.height)
        places = path.cleaned(trans + self._up, True, clip, simplify=False)
        at = _vertices(places)[np.isin(_codes(places), (Path.MOVETO, Path.LINETO))]
        uses = f'<use xlink:href="#{name}" x="%.2f" y="%.2f"/>' * len(at) % tuple(at.ravel().tolist())
        self._elements.append(f"<g{_paint(gc, rgbFace)}{self._clip(gc)}>{uses}</g>")

    def draw_text(
        self,
        gc: GraphicsContextBase,
        x: float,
        y: float,
        s: str,
        prop: FontProperties,
        angle: float,
        ismath: bool | Literal["TeX"] = False,
        mtext: Text | None = None,
    ) -> None:
        """A line of text, aligned by the browser where `mtext` is this line alone; an equation as outlines."""
        if ismath:
            super().draw_text(gc, x, y, s, prop, angle, ismath, mtext)
            return
        anchor = ""
        if mtext is not None and (angle == 0 or mtext.get_rotation_mode() == "anchor"):
            # The line stays where it is across its direction, and moves to its anchor along it.
            at = mtext.get_transform().transform(mtext.get_unitless_position())
            along = np.array([np.cos(np.deg2rad(angle)), -np.sin(np.deg2rad(angle))])
            x, y = np.array([x, y]) + along * (along @ (at[0] - x, self.height - at[1] - y))
            anchor = f' text-anchor="{_ANCHORS[mtext.get_horizontalalignment()]}"'
        turn = f' transform="rotate({-angle:.6g} {x:.2f} {y:.2f})"' if angle else ""
        opacity = gc.get_alpha() if gc.get_forced_alpha() else gc.get_rgb()[3]
        faint = f' fill-opacity="{opacity:.6g}"' if opacity != 1.0 else ""
        text = (
            f'<text x="{x:.2f}" y="{y:.2f}" fill="{to_hex(gc.get_rgb())}"{faint}{_font(prop)}{anchor}{turn}>'
            f"{escape(escaped_lines(s), quote=False)}</text>"
        )
        # A clip of the text itself would be turned with it.
        clip = self._clip(gc)
        self._elements.append(f"<g{clip}>{text}</g>" if clip else text)

    def draw_image(
        self,
        gc: GraphicsContextBase,
        x: float,
        y: float,
        im: ArrayLike,
        transform: Affine2DBase | None = None,
    ) -> None:
        """An image whose first row is its lowest."""
        pixels = np.asarray(im)[::-1]
        file = io.BytesIO()
        imsave(file, pixels, format="png")
        height, width = (size / _IMAGE_SCALE for size in pixels.shape[:2])
        self._elements.append(
            f'<image x="{x:.2f}" y="{self.height - y - height:.2f}" width="{width:.2f}" height="{height:.2f}" '
            f'xlink:href="data:image/png;base64,{base64.b64encode(file.getvalue()).decode("ascii")}"{self._clip(gc)}/>'
        )

    def get_image_magnification(self) -> float:
        """Pixels per point."""
        return _IMAGE_SCALE

    def get_text_width_height_descent(
        self, s: str, prop: FontProperties, ismath: bool | Literal["TeX"]
    ) -> tuple[float, float, float]:
        """Size of a line of text [pt]."""
        return _extent(escaped_lines(s), prop, ismath)

    def get_canvas_width_height(self) -> tuple[float, float]:
        """Size of the figure [pt]."""
        return self.width, self.height

    def _clip(self, gc: GraphicsContextBase) -> str:
        path, transform = gc.get_clip_path()
        rectangle = gc.get_clip_rectangle()
        if path is not None and transform is not None:
            # A path, though the annotations of matplotlib have it as transformed.
            outline = cast(Path, path).cleaned(transform + self._up, simplify=False, curves=True)
            shape = f'<path d="{_data(outline)}"/>'
        elif rectangle is not None:
            left, bottom, width, height = rectangle.bounds
            top = self.height - bottom - height
            shape = f'<rect x="{left:.2f}" y="{top:.2f}" width="{width:.2f}" height="{height:.2f}"/>'
        else:
            return ""
        name = self._named(f'<clipPath id="{{}}">{shape}</clipPath>')
        return f' clip-path="url(#{name})"'

    def _named(self, element: str) -> str:
        """The name of an element that others use, which is written once."""
        name = self._names.get(element)
        if name is None:
            name = self._names[element] = f"{self._identifier}-{len(self._names) + 1}"
            self._elements.append(f"<defs>{element.format(name)}</defs>")
        return name


def _paint(gc: GraphicsContextBase, face: ColorType | None) -> str:
    """Attributes of an area and its edge; joins are round by the figure's own attribute."""
    offset, dashes = gc.get_dashes()
    return _painted(
        None if face is None else to_rgba(face),
        gc.get_rgb(),
        gc.get_alpha() if gc.get_forced_alpha() else None,
        gc.get_linewidth(),
        (offset, *np.asarray(dashes).tolist()) if dashes is not None else (),
        gc.get_joinstyle(),
        gc.get_capstyle(),
    )


@lru_cache(maxsize=1024)
def _painted(
    face: _Colour | None,
    edge: _Colour,
    alpha: float | None,
    width: float,
    dashes: tuple[float, ...],
    join: str,
    cap: str,
) -> str:
    written = ' fill="none"' if face is None else f' fill="{to_hex(face)}"{_opacity("fill", face, alpha)}'
    if alpha is not None and alpha != 1.0:
        written += f' opacity="{alpha:.6g}"'
    if width:
        written += f' stroke="{to_hex(edge)}" stroke-width="{width:.6g}"{_opacity("stroke", edge, alpha)}'
        if dashes:
            written += f' stroke-dasharray="{",".join(f"{each:.6g}" for each in dashes[1:])}"'
            written += f' stroke-dashoffset="{dashes[0]:.6g}"' if dashes[0] else ""
        written += f' stroke-linejoin="{join}"' if join != "round" else ""
        written += f' stroke-linecap="{_CAPS[cap]}"' if cap != "butt" else ""
    return written


def _opacity(what: str, colour: _Colour, alpha: float | None) -> str:
    own = colour[3]
    return f' {what}-opacity="{own:.6g}"' if alpha is None and own != 1.0 else ""


def _font(prop: FontProperties) -> str:
    family = ", ".join(repr(name) for name in prop.get_family())
    weight = _WEIGHTS.get(str(prop.get_weight()), prop.get_weight())
    slant = f' font-style="{prop.get_style()}"' if prop.get_style() != "normal" else ""
    heavy = f' font-weight="{weight}"' if weight != 400 else ""
    return f' font-family="{escape(family)}" font-size="{prop.get_size_in_points():.6g}"{heavy}{slant}'


@lru_cache(maxsize=4096)
def _extent(line: str, prop: FontProperties, ismath: bool | Literal["TeX"]) -> tuple[float, float, float]:
    return text_to_path.get_text_width_height_descent(line, prop, ismath)


def _data(path: Path) -> str:
    """The `d` of a path element, to a hundredth of a point: far below what a screen or a printer shows."""
    pattern, left = [], 0
    codes = _codes(path)
    for code in codes.tolist():
        if left:
            pattern.append(" %.2f %.2f")
            left -= 1
        else:
            written, left = _SEGMENTS[code]
            pattern.append(written)
    drawn = _vertices(path)[(codes != Path.CLOSEPOLY) & (codes != Path.STOP)]
    return "".join(pattern) % tuple(drawn.ravel().tolist())


def _codes(cleaned: Path) -> NDArray[np.uint8]:
    return np.asarray(cleaned.codes, dtype=np.uint8)


def _vertices(cleaned: Path) -> NDArray[np.float64]:
    return np.asarray(cleaned.vertices, dtype=np.float64)
