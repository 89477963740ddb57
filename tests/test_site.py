"""The site of the documentation: it builds without a warning, every link leads somewhere, and nothing is fetched."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers.driven_browser import PHONE, Browser, needs_axe, needs_chromium
from uq.cli.main import COMMANDS

DOCS = Path(__file__).parents[1] / "docs"


def anchors(page):
    """The headings of a page as Sphinx names them, and the names that it gives itself."""
    text = page.read_text("utf-8")
    headings = re.findall(r"^#+ (.+)$", text, flags=re.M)
    plain = (re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower() for heading in headings)
    return {re.sub(r"[^\w -]", "", heading).replace(" ", "-") for heading in plain} | set(
        re.findall(r'id="([^"]+)"', text)
    )


def test_every_link_to_a_place_on_a_page_leads_there():
    """In what is written by hand; that pages are there at all: ``test_readme.py``."""
    for page in DOCS.rglob("*.md"):
        for target, anchor in re.findall(r"\]\(([^)#:]*)#([^)]+)\)", page.read_text("utf-8")):
            there = page.parent / target if target else page
            assert "generated/" in target or there.suffix != ".md" or anchor in anchors(there), (page, target, anchor)


def test_every_page_is_listed_and_no_page_fetches():
    contents = (DOCS / "index.md").read_text("utf-8").splitlines()
    for page in DOCS.glob("*/*.md"):
        name = page.relative_to(DOCS).with_suffix("").as_posix()
        assert name in contents or name.startswith("generated/"), name
        assert not re.search(
            r'<(?:script|img|link|iframe|source)\b[^>]*(?:src|href)="(?:https?:)?//', page.read_text("utf-8")
        ), name


# --- as Sphinx makes it ---


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


@pytest.mark.slow
def test_every_link_leads_somewhere(site):
    folder, pages = site
    for name, text in pages.items():
        for target in re.findall(r'(?:href|src)="([^"#:?]+)["#?]', text):
            assert (folder / name).parent.joinpath(target).exists(), (name, target)
        for target, anchor in re.findall(r'href="([^"#:]*)#([^"]+)"', text):
            place = (folder / name).parent.joinpath(target) if target else folder / name
            assert f'id="{anchor}"' in place.read_text("utf-8") or anchor == "", (name, target, anchor)


@pytest.mark.slow
def test_nothing_is_fetched_from_elsewhere(site):
    for name, text in site[1].items():
        tags = re.findall(r"<(?:script|img|link|iframe|source)\b[^>]*>", text)
        assert not [tag for tag in tags if re.search(r'(?:src|href)="(?:https?:)?//', tag)], name


@pytest.mark.slow
def test_every_page_is_in_the_contents(site):
    start = site[1]["index.html"]
    for page in DOCS.glob("*/*.md"):
        assert f'href="{page.relative_to(DOCS).with_suffix(".html").as_posix()}"' in start, page


@pytest.mark.slow
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


@pytest.mark.slow
@needs_chromium
def test_no_page_moves_sideways_on_a_phone(site, tmp_path):
    """What is too wide, such as a table, moves by itself; Furo's content does what a page's root does elsewhere."""
    with Browser(tmp_path, "") as browser:
        wide = {}
        for name in site[1]:
            browser.load((site[0] / name).as_uri())
            browser.show(PHONE)
            wide[name] = browser.run(
                "Math.max(...['html', '.content'].flatMap((part) => [...document.querySelectorAll(part)])"
                ".map((part) => part.scrollWidth))"
            )
    assert len(wide) > 50
    assert {name: width for name, width in wide.items() if width > PHONE} == {}


@pytest.mark.slow
def test_commands_and_keys_are_those_of_the_code(site):
    commands = site[1]["generated/commands.html"]
    for name in COMMANDS:
        assert f'id="inertia-{name}"' in commands
    assert "--patience" in commands
    assert "r_cg_from_q" in site[1]["generated/experiment-file.html"]
    assert "uq.montecarlo" in site[1]["generated/names-uq.html"]
