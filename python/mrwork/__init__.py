"""Identify magnetorheological dampers from test records, and control structures with them.

The public names stand in `__init__.pyi`, here and in each namespace; a module is loaded when one of its names is first
used, so that `import mrwork` costs little more than the interpreter.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
