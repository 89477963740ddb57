"""The commands of ``inertia``: each module is a thin layer over a public function.

A command module defines ``configure(parser)``, which adds its arguments; ``run(arguments) -> int``, which returns the
exit status; and ``ERRORS``, the exceptions that are the user's mistakes and end in one line and exit status 2.
"""
