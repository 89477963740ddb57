"""The command ``inertia``: one module a command, each a thin layer over a public function."""
