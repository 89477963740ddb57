"""The shape of the house: small modules, small rooms, floors in the order of the list, and a linter that sees cycles."""

import ast
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks import house

ROOT = Path(__file__).parent.parent


def test_no_module_is_long():
    paths = [path for room in house.rooms() for path in room.glob("*.py")]
    assert not {str(path.relative_to(ROOT)) for path in paths if house.lines(path) > 500}


def test_no_room_is_crowded():
    assert not {str(room) for room in house.rooms() if len(house.modules(room)) > 16}


def test_a_name_of_a_class_is_used_once():
    assert not house.repeated_classes()


def test_a_call_of_many_arguments_names_them():
    """A record of many fields is read by its fields' names, and a field that is put between them moves none."""
    assert not house.positional_calls()


TESTS = ROOT / "tests"
ABOVE_A_FLOOR = {"identify": {"uq", "rig"}, "rig": {"uq", "identify"}}
"""Packages that a floor's tests do not import, neither themselves nor by a helper or a fixture."""


def imported(node: ast.AST) -> set[str]:
    """Every module that is imported below a node of the syntax tree, and what is taken from it, by dotted names."""
    names = set()
    for part in ast.walk(node):
        if isinstance(part, ast.Import):
            names |= {alias.name for alias in part.names}
        elif isinstance(part, ast.ImportFrom):
            names |= {str(part.module), *(f"{part.module}.{alias.name}" for alias in part.names)}
    return names


def test_tests_keep_the_floors_and_import_no_other_tests():
    trees = {path: ast.parse(path.read_text("utf-8")) for path in TESTS.rglob("*.py")}
    helpers = {
        f"tests.helpers.{path.stem}": imported(tree) for path, tree in trees.items() if path.parent.stem == "helpers"
    }
    fixtures = {
        node.name: imported(node) | {argument.arg for argument in node.args.args}
        for node in trees[TESTS / "conftest.py"].body
        if isinstance(node, ast.FunctionDef) and node.decorator_list
    }
    assert fixtures
    wrong = []
    for path, tree in trees.items():
        names = imported(tree)
        wrong += [f"{path.stem}: {name}" for name in names if re.match(r"tests\.(?!helpers)", name)]
        names |= {part.arg for part in ast.walk(tree) if isinstance(part, ast.arg)}
        while more := set().union(*((helpers | fixtures).get(name, set()) for name in names)) - names:
            names |= more
        floor = path.relative_to(TESTS).parts[0]
        packages = {name.split(".")[0] for name in names}
        wrong += [f"{path}: {package}" for package in packages & ABOVE_A_FLOOR.get(floor, set())]
    assert not wrong


def test_every_room_says_what_it_is_for():
    assert not [room for room in house.rooms() if not (room / "__init__.py").read_text("utf-8").startswith('"""')]


def test_the_list_of_rooms_is_of_this_house():
    """Otherwise: ``python -m benchmarks.house --write``."""
    assert house.PAGE.read_text("utf-8") == house.page_with_listing()


def test_every_path_that_the_documentation_names_exists():
    for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        for path in re.findall(
            r"\b(?:uq|identify|rig|tests|benchmarks|docs)/[\w/.-]+\.(?:py|toml)\b", page.read_text("utf-8")
        ):
            assert (ROOT / path).exists(), f"{page.name}: {path}"


HANGING = re.compile(
    r"(?:about|above|across|against|along|among|as|at|before|behind|below|beside|between|beyond|by|for|from|in|into|of|"
    r"on|over|per|since|through|to|under|until|with|within|without|how|if|what|when|where|which|who|whose|why|its?|"
    r"their|they|these|those|that|this|likewise|missing|none|nothing|the same|the other)\b",
    re.IGNORECASE,
)
"""First words that lean on a name or a text which a reader of this docstring alone does not see."""


def is_fragment(text: str) -> bool:
    """Whether the first sentence starts with such a word, unless it is a question, or has fewer than three words."""
    sentence = re.split(r"(?<=[.?])\s", " ".join(text.split()), maxsplit=1)[0]
    words = re.findall(r"[^\W\d_]+", re.sub(r"\[[^]]*\]", "", sentence))  # without [units]
    return len(words) < 3 or (bool(HANGING.match(sentence)) and not sentence.endswith("?"))


def docstrings(node: ast.AST) -> Iterator[tuple[int, str]]:
    """Every docstring below a node of the syntax tree, those of attributes and constants included, with its line."""
    body = getattr(node, "body", None)
    if not isinstance(body, list):
        return
    documented = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
    for before, statement in zip([None, *body], body, strict=False):
        if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
            first = before is None and documented
            if isinstance(statement.value.value, str) and (first or isinstance(before, ast.Assign | ast.AnnAssign)):
                yield statement.lineno, statement.value.value
        yield from docstrings(statement)


def test_a_docstring_stands_alone():
    """A reader of a hover, a tooltip or one line of the reference sees it without its neighbours."""
    assert not [
        f"{path.relative_to(ROOT)}:{line}: {text}"
        for room in house.rooms()
        for path in room.glob("*.py")
        for line, text in docstrings(ast.parse(path.read_text("utf-8")))
        if is_fragment(text)
    ]


def descriptions(schema: object) -> Iterator[str]:
    """What a schema says of its keys, without the unit that is appended to it."""
    if isinstance(schema, dict):
        if isinstance(schema.get("description"), str):
            yield re.sub(r"\s*With its unit, such as .*", "", schema["description"])
        schema = list(schema.values())
    if isinstance(schema, list):
        for item in schema:
            yield from descriptions(item)


@pytest.mark.parametrize("path", sorted((ROOT / "uq" / "schemas").glob("*.json")), ids=lambda path: path.name)
def test_a_schema_says_what_a_key_is(path):
    assert not {text for text in descriptions(json.loads(path.read_text("utf-8"))) if text and is_fragment(text)}


PLANTED = {
    "identify/rigid_body/rotation.py": "from identify.rigid_body.inertial_parameters import InertialParameters",
    "identify/rigid_body/inertia.py": "from identify.signals.run import Run",
    "uq/cli/paper.py": "from uq import montecarlo",
    "rig/runs.py": "from identify.rigid_body.inertia import pack",
}
"""A cycle of files in one room, a room that imports from above, a door, another package."""


def test_the_linter_sees_a_lazy_import(tmp_path):
    for package in house.PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for path, statement in PLANTED.items():
        with open(tmp_path / path, "a") as file:
            file.write(f"\n\ndef planted():\n    {statement}\n")
    code = (
        "import sys; sys.path.insert(0, ''); from importlinter.cli import lint_imports_command; lint_imports_command()"
    )
    ran = subprocess.run([sys.executable, "-c", code, "--no-cache"], cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 1, ran.stdout + ran.stderr
    for complaint in (
        r"\.rotation -> \.inertial_parameters",
        r"identify\.rigid_body\.inertia -> identify\.signals\.run \(",
        r"uq\.cli\.paper -> uq \(",
        r"rig\.runs -> identify\.rigid_body\.inertia \(",
    ):
        assert re.search(rf"^- +{complaint}", ran.stdout, re.M), ran.stdout
