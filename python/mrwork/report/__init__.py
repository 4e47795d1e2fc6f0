"""What a person reads of a fit: figures, the HTML report, and the run directory that keeps both.

`html.identification_report` writes the page, `figures` draws, `run_directory` stores and reads back.
Import the submodules; this package loads neither matplotlib nor jinja2.
"""
