"""The house in figures: ``python -m benchmarks.house`` prints the rooms' sizes.

Lines of code are neither docstring, comment, blank nor import.
``--write`` renews the list of rooms in docs/explanation/architecture.md, from the import linter's floors in
pyproject.toml and the rooms' docstrings. ``--closure`` counts the modules of ours that two entrances import.
"""

import argparse
import ast
import io
import subprocess
import sys
import tokenize
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from identify.display.text_tables import text_table

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "explanation" / "architecture.md"
BEGIN, END = "<!-- written by python -m benchmarks.house --write -->\n", "<!-- end of the list -->\n"
PACKAGES = ("uq", "identify", "rig")
ENTRANCES = {
    "from uq import montecarlo": "from uq import montecarlo",
    "inertia paper --trials 2": "import tempfile; from uq.cli.main import main; "
    "main(['paper', '--trials', '2', '--out', tempfile.mkdtemp()])",
}
COUNT = """
import sys
names = [m for n, m in sys.modules.items() if n.split('.')[0] in ('uq', 'identify', 'rig')]
print(sum(not (m.__file__ or '').endswith('__init__.py') for m in names))
"""


LAYOUT = (
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER,
)  # fmt: skip
"""Tokens that make no line of code."""


def modules(folder: Path) -> list[Path]:
    """Return the modules that lie in a folder itself, in order, without ``__init__``."""
    return sorted(path for path in folder.glob("*.py") if path.name != "__init__.py")


def rooms() -> Iterator[Path]:
    """Return the packages' folders of modules, in order."""
    for package in PACKAGES:
        yield from sorted({path.parent for path in (ROOT / package).rglob("*.py")})


def lines(path: Path) -> int:
    """Return how many lines a file has."""
    return len(path.read_text("utf-8").splitlines())


def code_lines(path: Path) -> int:
    """Return how many lines of a file are code: neither docstring, comment, blank nor import."""
    text = path.read_text("utf-8")
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    code = {line for t in tokens if t.type not in LAYOUT for line in range(t.start[0], t.end[0] + 1)}
    for node in ast.walk(ast.parse(text)):
        docstring = (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        )
        if isinstance(node, ast.stmt) and (docstring or isinstance(node, ast.Import | ast.ImportFrom)):
            code -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(code)


def table() -> str:
    """Return modules, lines, code lines and largest module of every room, of each package and in all."""
    rows = [_row("in all", [path for room in rooms() for path in room.glob("*.py")])]
    for package in PACKAGES:
        inside = [room for room in rooms() if room.relative_to(ROOT).parts[0] == package]
        rows.append(_row(package, [path for room in inside for path in room.glob("*.py")]))
        for room in inside:
            largest = max(modules(room), key=lines, default=room / "__init__.py")
            row = _row(f"  {room.relative_to(ROOT)}", list(room.glob("*.py")))
            rows.append([*row[:-1], f"{largest.stem} {lines(largest)}"])
    return text_table(["", "modules", "lines", "code", "largest"], rows)


def _row(name: str, paths: list[Path]) -> list[str]:
    count = sum(path.name != "__init__.py" for path in paths)
    return [name, *(f"{n:,}" for n in (count, sum(map(lines, paths)), sum(map(code_lines, paths)))), ""]


def repeated_classes() -> dict[str, list[str]]:
    """Return the names of classes that several modules define, with the modules."""
    places = defaultdict[str, list[str]](list)
    for path, node in _nodes():
        if isinstance(node, ast.ClassDef):
            places[node.name].append(str(path.relative_to(ROOT)))
    return {name: paths for name, paths in places.items() if len(paths) > 1}


def positional_calls(most: int = 6) -> list[str]:
    """Return the calls with more positional arguments than this, each as file and line."""
    return [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path, node in _nodes()
        if isinstance(node, ast.Call) and len(node.args) > most
    ]


def _nodes() -> Iterator[tuple[Path, ast.AST]]:
    for room in rooms():
        for path in room.glob("*.py"):
            for node in ast.walk(ast.parse(path.read_text("utf-8"))):
                yield path, node


def floors(package: str) -> list[list[str]]:
    """Return the floors of a package or wing from above, those side by side in a list, as the import linter has them.

    Empty: no contract states an order.
    """
    with open(ROOT / "pyproject.toml", "rb") as file:
        contracts = tomllib.load(file)["tool"]["importlinter"]["contracts"]
    layers = next((each["layers"] for each in contracts if each.get("containers") == [package]), [])
    return [[name.strip() for name in layer.split("|")] for layer in layers]


def place(package: str, name: str) -> Path:
    """Return a room's folder, or the module of that name beside the rooms."""
    folder = ROOT.joinpath(*package.split("."), name)
    return folder if folder.is_dir() else folder.with_suffix(".py")


def purpose(path: Path) -> str:
    """Return the first line of a room's or module's docstring."""
    path = path / "__init__.py" if path.is_dir() else path
    return (ast.get_docstring(ast.parse(path.read_text("utf-8"))) or "").split("\n")[0].replace("``", "`")


def listing() -> str:
    """Return wings, rooms and modules beside them, with what each is for; what imports stands above what it imports."""
    text = []
    for package in PACKAGES:
        text += ["", f"## {package}", "", *entries(package)]
    return "\n".join([*text[1:], ""])


def entries(package: str) -> Iterator[str]:
    """Return a line for each part of a package or wing, its own parts indented below it."""
    listed = [name for floor in floors(package) for name in floor]
    folder = ROOT.joinpath(*package.split("."))
    rooms = sorted(path.parent.name for path in folder.glob("*/__init__.py"))
    for name in listed or rooms:
        path, indent = place(package, name), "  " * package.count(".")
        yield f"{indent}- `{path.relative_to(folder)}`: {purpose(path)}"
        yield from entries(f"{package}.{name}")


def page_with_listing() -> str:
    """Return docs/explanation/architecture.md with the list of rooms at its place."""
    before, rest = PAGE.read_text("utf-8").split(BEGIN)
    return f"{before}{BEGIN}\n{listing()}\n{END}{rest.split(END)[1]}"


def closure() -> str:
    """Return how many modules of ours each entrance imports, counted in a process of its own."""
    counts = []
    for name, code in ENTRANCES.items():
        ran = subprocess.run([sys.executable, "-c", code + COUNT], cwd=ROOT, capture_output=True, text=True, check=True)
        counts.append(f"{name}: {ran.stdout.split()[-1]} modules")
    return "\n".join(counts)


def main() -> int:
    """Print what is asked for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.house", description=__doc__)
    parser.add_argument("--write", action="store_true", help="renew the list in docs/explanation/architecture.md")
    parser.add_argument("--closure", action="store_true", help="count the modules that two entrances import")
    options = parser.parse_args()
    if options.write:
        PAGE.write_text(page_with_listing(), "utf-8")
    print(closure() if options.closure else table())
    if not options.closure:
        print(f"\nnames of classes that repeat: {len(repeated_classes())}")
        print(f"calls with more than six positional arguments: {len(positional_calls())}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
