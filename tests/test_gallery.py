"""The pictures of the pages: each is used, and one command makes them all."""

import re
import runpy
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import matplotlib.image
import pytest

ROOT = Path(__file__).parents[1]
FIGURES = ROOT / "docs" / "figures"


def test_every_picture_is_made_by_the_command_and_shown_on_a_page(monkeypatch):
    monkeypatch.syspath_prepend(FIGURES)
    made = set(runpy.run_path(str(FIGURES / "gallery.py"))["PICTURES"])
    assert {path.name for path in FIGURES.iterdir() if path.suffix in (".png", ".svg")} == made
    pages = [*(ROOT / "docs").glob("**/*.md"), ROOT / "README.md"]
    assert {name for page in pages for name in re.findall(r"figures/([\w-]+\.\w+)\)", page.read_text("utf-8"))} == made


@pytest.mark.slow
def test_the_command_draws_a_picture_and_a_drawing(tmp_path):
    command = [sys.executable, FIGURES / "gallery.py", "spheres.png", "frames.svg", "--out", tmp_path]
    subprocess.run(command, check=True, capture_output=True, cwd=ROOT)
    committed, drawn = (matplotlib.image.imread(folder / "spheres.png") for folder in (FIGURES, tmp_path))
    assert committed.shape == drawn.shape
    assert ElementTree.parse(tmp_path / "frames.svg").getroot().tag.endswith("svg")
