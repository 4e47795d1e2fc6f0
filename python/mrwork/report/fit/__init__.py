"""The sections of the identification dossier: each made of one file of a run directory, and absent without it.

`section` says what a section consists of, `page` puts a run's sections together, `renew` writes the page anew. Where a
section has figures they are in a module of their own, `..._figures`.
"""
