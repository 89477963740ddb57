"""What ``import identify`` and ``import uq`` offer: few names, typed, documented, with an example and a test each."""

import ast
import importlib
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("identify", "uq", "rig")
ALIASES = {
    "identify": {"PrecisionWarning", "RunEstimate"},
    "uq": {"PaperResult", "SimulatedRun", "Source"},
    "rig": set(),
}
"""Names of version 0.1 that stay until 0.3."""
DOORS = [(package, name) for package in PACKAGES for name in importlib.import_module(package).__all__]
NAMES = [(package, name) for package, name in DOORS if name not in ALIASES[package]]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def blocks(text):
    """The Python of a page."""
    return re.findall(r"```python\n(.*?)```", text, flags=re.S)


def imported(code):
    """What a piece of Python imports, as (module, name)."""
    nodes = [node for node in ast.walk(ast.parse(code)) if isinstance(node, ast.ImportFrom)]
    return {(node.module, alias.name) for node in nodes if node.module for alias in node.names}


def test_a_door_offers_few_names():
    for package in PACKAGES:
        door = importlib.import_module(package)
        assert 10 <= len(set(door.__all__) - ALIASES[package]) <= 40
        assert set(door.__all__) <= set(dir(door))
        with pytest.raises(AttributeError, match=f"{package} .*nonsense"):
            _ = door.nonsense


def test_a_public_name_has_a_docstring():
    documented = [(getattr(importlib.import_module(package), name).__doc__ or "").strip() for package, name in NAMES]
    assert all(documented), NAMES[documented.index("")]


def test_the_page_lists_the_names_that_stay():
    """With an anchor each, that of the name's heading on its package's page; the aliases stand in the text below."""
    page = (ROOT / "docs/reference/api.md").read_text("utf-8")
    section = page.split("## Names that stay\n")[1].split("\n## ")[0]
    listed = re.findall(r"\[`(\w+)`\]\(/generated/names-(\w+)\.md#(\w+)\)", section)
    assert sorted((package, name) for name, package, _ in listed) == sorted(NAMES)
    assert all(anchor == name.lower() for name, _, anchor in listed)
    assert all(f"`{name}`" in section for names in ALIASES.values() for name in names)


def test_a_public_name_is_no_folder():
    """Importing anything from a folder of that name would put the folder in the name's place."""
    assert not [(package, name) for package, name in DOORS if (ROOT / package / name).is_dir()]


def test_an_alias_is_what_its_room_has():
    for package, names in ALIASES.items():
        assert names <= set(importlib.import_module(package).__all__)
        assert all(isinstance(getattr(importlib.import_module(package), name), type) for name in names)


def shown_code():
    """Each piece of Python that a notebook or a page of the documentation shows, with where it stands."""
    for path in PAGES:
        yield from ((path.name, code) for code in blocks(path.read_text("utf-8")))
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        cells = json.loads(path.read_text("utf-8"))["cells"]
        for cell in cells:
            lines = [line for line in cell["source"] if not line.startswith("%")]  # without Jupyter's own commands
            yield from [(path.name, "".join(lines))] * (cell["cell_type"] == "code")


def test_notebooks_and_pages_use_names_that_stay():
    """They import nothing of ours but these; extensions, which are files of a room, import from theirs."""
    for where, code in shown_code():
        ours = {(module, name) for module, name in imported(code) if module.split(".")[0] in PACKAGES}
        assert ours <= set(NAMES), where
        modules = {a.name for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Import) for a in node.names}
        assert not {module for module in modules if module.split(".")[0] in PACKAGES} - set(PACKAGES), where


def test_the_examples_import_what_there_is():
    examples = [code for page in PAGES for code in blocks(page.read_text("utf-8"))]
    for module, name in set().union(*map(imported, examples)):
        if module.split(".")[0] in PACKAGES:
            assert hasattr(importlib.import_module(module), name), (module, name)


def test_every_public_name_has_an_example():
    shown = set().union(*(imported(code) for page in PAGES for code in blocks(page.read_text("utf-8"))))
    assert not set(NAMES) - shown


def test_every_public_name_has_a_test():
    files = [path for path in (ROOT / "tests").rglob("*.py") if path != Path(__file__)]
    code = [path.read_text("utf-8") for path in files]
    imports = {(module.split(".")[0], name) for text in code for module, name in imported(text)}
    attributes = {node.attr for text in code for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Attribute)}
    assert not {(package, name) for package, name in set(NAMES) - imports if name not in attributes}


@pytest.mark.slow  # it checks all packages once more, unless `make check` has
def test_type_checkers_see_the_names(tmp_path):
    """No name is Any, the examples of docs/reference/api.md are well typed, and a name that is not offered is an error."""
    code = "\n".join(blocks((ROOT / "docs/reference/api.md").read_text("utf-8")))
    lines = [code, *(f"import {package} as {package}_door" for package in PACKAGES)]
    lines += [f"reveal_type({package}_door.{name})" for package, name in DOORS]
    lines += [f"{package}_door.nonsense" for package in PACKAGES]
    snippet = tmp_path / "snippet.py"
    snippet.write_text("\n".join(lines), "utf-8")
    ran = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", ROOT / "pyproject.toml", snippet],
        cwd=ROOT, env={**os.environ, "MYPYPATH": str(ROOT)}, capture_output=True, text=True,
    )  # fmt: skip
    revealed = re.findall(r'note: Revealed type is "(.*)"', ran.stdout)
    assert len(revealed) == len(DOORS), ran.stdout + ran.stderr
    assert not [kind for kind in revealed if kind in ("Any", "builtins.object")]
    errors = re.findall(r"error: (.*)", ran.stdout)
    assert errors == ['Module has no attribute "nonsense"  [attr-defined]' for _ in PACKAGES], ran.stdout
