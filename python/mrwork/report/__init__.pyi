from .pages import write_page as write_page
