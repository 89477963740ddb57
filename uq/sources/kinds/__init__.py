"""The kinds of error, one file each; loading the entry points of the group ``inertia_uq.sources`` registers them.

A new kind is a subclass of :class:`uq.sources.source.ErrorKind`; see docs/how-to/extending.md.
"""

from importlib.metadata import entry_points

from uq.sources import recorded_kinds

ENTRIES = entry_points(group="inertia_uq.sources")
if not ENTRIES:  # a checkout that was installed when its kinds of error were no entry points yet
    raise ImportError("inertia-uq has no kinds of error: reinstall it (make env, pip install)")
for entry in ENTRIES:
    entry.load()
recorded_kinds.register()
