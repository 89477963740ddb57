"""The shape of the house: small modules, small rooms, floors in the order of the list, and a linter that sees cycles."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks import house

ROOT = Path(__file__).parent.parent


def test_no_module_is_long():
    paths = [path for room in house.rooms() for path in room.glob("*.py")]
    assert not {str(path.relative_to(ROOT)) for path in paths if house.lines(path) > 350}


def test_no_room_is_crowded():
    assert not {str(room) for room in house.rooms() if len(house.modules(room)) > 14}


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


CYCLE = "identify/rigid_body/rotation.py", "from identify.rigid_body.inertial_parameters import InertialParameters"
ABOVE = "identify/rigid_body/inertia.py", "from identify.signals.run import Run"
DOOR = "uq/cli/paper.py", "from uq import montecarlo"
ACROSS = "rig/runs.py", "from identify.rigid_body.inertia import pack"


@pytest.mark.parametrize(
    ("place", "broken"),
    [(CYCLE, "No cycle"), (ABOVE, "The floors of identify"), (DOOR, "through a door"), (ACROSS, "run one way")],
)
def test_the_linter_sees_a_lazy_import(tmp_path, place, broken):
    """A cycle of files in one room, a room that imports from above, a door, another package; inside a function."""
    for package in house.PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    with open(tmp_path / place[0], "a") as file:
        file.write(f"\n\ndef planted():\n    {place[1]}\n")
    code = (
        "import sys; sys.path.insert(0, ''); from importlinter.cli import lint_imports_command; lint_imports_command()"
    )
    ran = subprocess.run([sys.executable, "-c", code, "--no-cache"], cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 1, ran.stdout + ran.stderr
    assert [line for line in ran.stdout.splitlines() if broken in line and line.endswith("BROKEN")], ran.stdout
