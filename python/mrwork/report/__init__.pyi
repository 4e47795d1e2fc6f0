from ..plots.damper_figures import cross_section_figure as cross_section_figure
from ..plots.damper_figures import parameter_effects_figure as parameter_effects_figure
from ..plots.response_sheet import response_sheet_figure as response_sheet_figure
from .pages import write_page as write_page
