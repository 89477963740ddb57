"""Every block of code on the documentation's pages runs as it stands, and prints what the page says that it prints.

A page's blocks run in order, in a folder that is empty at first, as a reader's: ``python`` in one namespace, in
double precision only if the page switches it on; ``console`` by the command itself, with ``…`` for anything in what it
prints; ``toml`` is read. The line ``<!-- study -->`` above a block keeps it and those below it for ``make study``;
``<!-- not run -->`` leaves one out.
"""

import ast
import contextlib
import importlib
import io
import re
import shlex
import tomllib
import warnings
from pathlib import Path

import jax
import pytest

from identify.floating_point import PrecisionWarning
from uq.cli.main import main

DOCS = Path(__file__).parents[1] / "docs"
BLOCK = re.compile(r"(?:<!-- (study|not run) -->\n+)?^```(python|console|toml)\n(.*?)^```$", re.S | re.M)
PAGES = sorted(
    page.relative_to(DOCS).as_posix()
    for folder in ("tutorials", "how-to", "reference", "explanation")
    for page in (DOCS / folder).glob("*.md")
)
ELSEWHERE = {"how-to/extending.md": "tests/test_extending.py"}
"""Pages whose blocks another test runs."""
WAITING = {
}  # fmt: skip
"""Pages that are still to be rewritten."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")
    return tmp_path


def blocks(page, *, study):
    """The kind, first line and code of each block that is to run."""
    text, slow = (DOCS / page).read_text("utf-8"), False
    for match in BLOCK.finditer(text):
        mark, kind, code = match.groups()
        slow |= mark == "study"
        if mark != "not run" and (study or not slow):
            yield kind, text[: match.start(3)].count("\n") + 1, code


def session(code):
    """The commands of a console and what the page says that each prints."""
    for part in re.split(r"^\$ ", code, flags=re.M)[1:]:
        command, _, printed = part.replace("\\\n", " ").partition("\n")
        yield command, printed.strip("\n")


def command(line):
    """Run a command line; return its exit status (1: done, and something is suspicious or missing) and what it prints."""
    words, out = shlex.split(line), io.StringIO()
    assert words[0] == "inertia", f"only inertia is run: {line}"
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        try:
            status = main(words[1:])
        except SystemExit as end:
            status = int(end.code or 0)
    return status, out.getvalue()


def assert_printed(expected, printed, where):
    """Each line of the page is in what was printed, in order; ``…`` stands for anything."""
    lines = iter(" ".join(line.split()) for line in printed.splitlines())
    for line in filter(None, (" ".join(line.split()) for line in expected.splitlines())):
        pattern = ".*".join(re.escape(piece) for piece in line.split("…"))
        assert any(re.fullmatch(pattern, other) for other in lines), f"{where}: not printed: {line}\n\n{printed}"


def run_python(code, names, *, double):
    """Run code of a page in its reader's precision and return it afterwards; float32 by mistake is an error."""
    jax.config.update("jax_enable_x64", double)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", PrecisionWarning)
            exec(code, names)
        return jax.config.jax_enable_x64
    finally:
        jax.config.update("jax_enable_x64", True)


def run(page, *, study):
    names, double = {"__name__": "page"}, False
    for kind, line, code in blocks(page, study=study):
        where = f"docs/{page}:{line}"
        if kind == "toml":
            tomllib.loads(code)
        elif kind == "python":
            compiled = compile("\n" * line + code, str(DOCS / page), "exec")
            double = run_python(compiled, names, double=double)
        else:
            for words, expected in session(code):
                status, printed = command(words)
                assert status == 0 or (status == 1 and expected) or "error:" in expected, (
                    f"{where}: {words} ended with {status}\n{printed}"
                )
                assert_printed(expected, printed, where)


DEAR = {
    "how-to/budget.md", "how-to/calibrate.md", "how-to/certificate.md", "how-to/export.md", "how-to/identify.md",
    "how-to/many-runs.md", "how-to/own-monte-carlo.md", "explanation/law.md",
}  # fmt: skip
"""Pages whose blocks take two seconds and more; that they call what exists is seen below."""


@pytest.mark.parametrize("study", [False, pytest.param(True, marks=pytest.mark.study)], ids=["quick", "all"])
@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=pytest.mark.slow) if page in DEAR else page
        for page in PAGES
        if page not in {*WAITING, *ELSEWHERE}
    ],
)
def test_the_blocks_of_a_page_run(page, study, folder):
    run(page, study=study)


@pytest.mark.parametrize("page", sorted(DEAR))
def test_what_a_page_calls_exists(page, monkeypatch):
    """Commands and their options, and what is imported."""
    for kind, line, code in blocks(page, study=True):
        if kind == "console":
            for words, _ in session(code):
                monkeypatch.setattr(f"uq.cli.{shlex.split(words)[1]}.run", lambda options: 0)
                assert command(words) == (0, ""), f"{page}:{line}"
        elif kind == "python":
            for node in ast.walk(ast.parse(code)):
                if isinstance(node, ast.ImportFrom):
                    module = importlib.import_module(node.module)
                    assert all(hasattr(module, alias.name) for alias in node.names), f"{page}:{line}"


def test_a_block_that_is_wrong_is_noticed(folder, tmp_path, monkeypatch):
    monkeypatch.setattr("tests.test_pages.DOCS", tmp_path)
    page = tmp_path / "page.md"
    for wrong in (
        "```python\nassert False\n```",
        "```console\n$ inertia inspect gone.mcap\n```",
        "```toml\na = \n```",
        "```console\n$ inertia --help\nno such line\n```",
        "```console\n$ python\n```",
    ):
        page.write_text(f"{wrong}\n")
        with pytest.raises((AssertionError, tomllib.TOMLDecodeError)):
            run("page.md", study=False)
    page.write_text("<!-- not run -->\n```python\nassert False\n```\n<!-- study -->\n```python\nassert False\n```\n")
    run("page.md", study=False)
    with pytest.raises(AssertionError):
        run("page.md", study=True)
