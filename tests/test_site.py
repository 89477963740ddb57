"""The site of the documentation: it builds without a warning, every link leads somewhere, and nothing is fetched."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers.driven_browser import Browser, needs_axe, needs_chromium
from uq.cli.main import COMMANDS

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The pages by their names, as Sphinx makes them; a warning is an error. Without listings of the code, a fifth of the time."""
    folder = tmp_path_factory.mktemp("site")
    arguments = [
        "-q",
        "-W",
        "--keep-going",
        "-b",
        "html",
        "-D",
        "extensions=myst_nb,sphinx.ext.autodoc,generated_pages",
        "-d",
        str(folder / "doctrees"),
        str(DOCS),
        str(folder / "html"),
    ]
    done = subprocess.run([sys.executable, "-m", "sphinx", *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    pages = (folder / "html").rglob("*.html")
    return folder / "html", {page.relative_to(folder / "html").as_posix(): page.read_text("utf-8") for page in pages}


def test_every_link_leads_somewhere(site):
    folder, pages = site
    for name, text in pages.items():
        for target in re.findall(r'(?:href|src)="([^"#:?]+)["#?]', text):
            assert (folder / name).parent.joinpath(target).exists(), (name, target)
        for target, anchor in re.findall(r'href="([^"#:]*)#([^"]+)"', text):
            place = (folder / name).parent.joinpath(target) if target else folder / name
            assert f'id="{anchor}"' in place.read_text("utf-8") or anchor == "", (name, target, anchor)


def test_nothing_is_fetched_from_elsewhere(site):
    for name, text in site[1].items():
        tags = re.findall(r"<(?:script|img|link|iframe|source)\b[^>]*>", text)
        assert not [tag for tag in tags if re.search(r'(?:src|href)="(?:https?:)?//', tag)], name


def test_every_page_is_in_the_contents(site):
    start = site[1]["index.html"]
    for page in DOCS.glob("*/*.md"):
        assert f'href="{page.relative_to(DOCS).with_suffix(".html").as_posix()}"' in start, page


@needs_chromium
@needs_axe
def test_axe_core_objects_to_nothing(site, tmp_path):
    with Browser(tmp_path, "") as browser:
        for page in ("index.html", "tutorials/recording.html", "generated/names-uq.html"):
            browser.load((site[0] / page).as_uri())
            for width in (390, 1400):
                for dark in (False, True):
                    browser.show(width, dark=dark)
                    assert browser.violations() == [], (page, width, dark)


def test_commands_and_keys_are_those_of_the_code(site):
    commands = site[1]["generated/commands.html"]
    for name in COMMANDS:
        assert f'id="inertia-{name}"' in commands
    assert "--patience" in commands
    assert "r_cg_from_q" in site[1]["generated/experiment-file.html"]
    assert "uq.montecarlo" in site[1]["generated/names-uq.html"]
