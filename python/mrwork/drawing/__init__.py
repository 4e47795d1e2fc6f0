"""Drawing that pages and `mr.plots` share: style, empty axes, and what is drawn into them, a file for each result."""

from mrwork.drawing import style as style
