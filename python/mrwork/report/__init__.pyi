from ..plots.damper_figures import cross_section_figure as cross_section_figure
from ..plots.damper_figures import parameter_effects_figure as parameter_effects_figure
from ..plots.response_sheet import response_sheet_figure as response_sheet_figure
from .pages import write_page as write_page

if True:  # the lower tier
    from ..drawing import style as style
    from ..drawing.canvas import SMALL as SMALL
    from ..drawing.canvas import WIDE as WIDE
    from ..drawing.canvas import blank as blank
    from ..drawing.canvas import draw_points as draw_points
    from ..drawing.canvas import finish as finish
    from .html import symbol as symbol
    from .html import write_study_page as write_study_page
    from .section import Panel as Panel
    from .section import Table as Table
    from .section import numbers as numbers
    from .section import panel as panel
