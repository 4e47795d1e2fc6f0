"""Reference pages of the documentation, from the registries, parsers, tables and stubs of the package.

Every module has pure functions that return MyST text; `pages` puts them together and writes them where Sphinx looks.
"""
