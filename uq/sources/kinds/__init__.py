"""The kinds of error, one file each; every file in this folder is imported, and what it defines is registered.

A new kind is one new file: a subclass of :class:`uq.sources.source.ErrorKind`; see docs/how-to/extending.md.
"""

from importlib import import_module
from pkgutil import iter_modules

for _file in iter_modules(__path__):
    import_module(f"{__name__}.{_file.name}")
