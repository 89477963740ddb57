"""The wheel: what is in it, that it runs from an empty folder, and that it knows another package named `identify`.

What it needs: declared, and locked.
"""

import ast
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parent.parent
PACKAGES = ("identify", "rig", "uq")
CURE = ": install inertia-uq into an environment of its own (uv tool, pipx, python -m venv)\n"
BUILD = "from setuptools.build_meta import build_wheel; print(build_wheel('dist'))"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder as an installer unpacks it, from a wheel that is built of a copy: building leaves traces."""
    source = tmp_path_factory.mktemp("source")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, source / package, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    ran = subprocess.run([sys.executable, "-c", BUILD], cwd=source, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    (wheel,) = source.glob("dist/*.whl")
    folder = tmp_path_factory.mktemp("site")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    return folder


def run(*arguments, path, cwd):
    environment = {"PYTHONPATH": ":".join(map(str, path)), "PATH": ""}
    ran = subprocess.run(
        [sys.executable, *map(str, arguments)], cwd=cwd, env=environment, capture_output=True, text=True
    )
    return ran.returncode, ran.stdout, ran.stderr


def test_the_wheel_has_every_file_of_the_packages_and_no_other(site):
    expected = {
        path.relative_to(ROOT)
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }
    packed = {path.relative_to(site) for path in site.rglob("*") if path.is_file()}
    (described,) = {path.parts[0] for path in packed} - set(PACKAGES)
    assert {path for path in packed if path.parts[0] != described} == expected
    assert {Path(package, "py.typed") for package in PACKAGES} <= packed
    metadata = (site / described / "METADATA").read_text("utf-8")
    assert "Classifier: Programming Language :: Python :: 3.11" in metadata
    assert "inertia = uq.cli.main:main" in (site / described / "entry_points.txt").read_text("utf-8")


def test_it_runs_from_an_empty_folder(site, tmp_path):
    code = "import uq, identify, rig; print(uq.__file__, identify.__file__, rig.__file__, uq.ExperimentError.__name__)"
    status, printed, complaint = run("-c", code, path=[site], cwd=tmp_path)
    assert (status, complaint) == (0, "")
    assert printed.split() == [*(str(site / p / "__init__.py") for p in ("uq", "identify", "rig")), "ExperimentError"]
    (described,) = site.glob("*.dist-info")
    version = described.name.removeprefix("inertia_uq-").removesuffix(".dist-info")
    assert run("-m", "uq", "--version", path=[site], cwd=tmp_path) == (0, f"inertia-uq {version}\n", "")
    status, printed, _ = run("-m", "uq", "schema", "body", path=[site], cwd=tmp_path)
    assert status == 0
    assert printed.startswith("{")
    for _ in range(2):  # what is there already may stay
        status, printed, complaint = run(
            "-m", "uq", "examples", "weigh", "rig-imu", "-o", "e", path=[site], cwd=tmp_path
        )
        assert (status, complaint) == (0, "")
        assert {*printed.split()} == {"e/weigh.toml", "e/weigh.csv", "e/rig-imu.toml"}
    schema = (tmp_path / "e/rig-imu.toml").read_text("utf-8").splitlines()[0].removeprefix("#:schema ")
    assert schema == (site / "uq/schemas/rig.json").as_uri()
    (tmp_path / "e/weigh.csv").write_text("mine")
    status, _, complaint = run("-m", "uq", "examples", "-o", "e", path=[site], cwd=tmp_path)
    assert (status, complaint.split(" and ")[0]) == (2, "error: e/weigh.csv is there")
    assert not (tmp_path / "e/robot.toml").exists()


@pytest.mark.parametrize("installed", ["after", "before", "elsewhere"])
def test_another_identify_is_named_with_the_cure(site, tmp_path, installed):
    """As pre-commit's dependency is laid out: an empty ``__init__.py`` and a module ``identify.py``."""
    shutil.copytree(site, tmp_path / "site")
    other = tmp_path / ("other" if installed == "elsewhere" else "site") / "identify"
    other.mkdir(parents=True, exist_ok=True)
    (other / "identify.py").write_text("def tags_from_path(path): ...\n")
    if installed != "before":
        (other / "__init__.py").write_text("")
    path = [other.parent, tmp_path / "site"]
    for arguments in (["--version"], ["montecarlo", "barreto2016"]):
        status, printed, complaint = run("-m", "uq", *arguments, path=path, cwd=tmp_path)
        assert (status, printed) == (2, "")
        assert complaint.startswith(f"error: another package named `identify` is in {other} ")
        assert complaint.endswith(CURE)
        assert complaint.count("\n") == 1


def test_what_another_identify_has_taken_along_is_missed(site, tmp_path):
    """Whoever removes it removes `identify/__init__.py`, which both have."""
    shutil.copytree(site, tmp_path / "site")
    (tmp_path / "site" / "identify" / "__init__.py").unlink()
    status, printed, complaint = run("-m", "uq", "--version", path=[tmp_path / "site"], cwd=tmp_path)
    assert (status, printed) == (2, "")
    assert complaint.startswith(f"error: files are missing in {tmp_path / 'site' / 'identify'}, ")
    assert complaint.endswith(CURE)


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
NOT_FOR_USERS = {"dev", "docs"}


def distribution(requirement):
    """Its name as the index writes it: ``Jinja2>=3.1`` is ``jinja2``."""
    return re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", requirement)[0]).lower()


def imports():
    """The modules of others that the packages import anywhere, by the syntax tree."""
    for path in (path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                yield from (alias.name.split(".")[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and not node.level:
                yield node.module.split(".")[0]


def test_what_is_imported_is_declared_and_what_is_declared_is_imported():
    """Not what another dependency happens to bring; a name that several distributions share stands for any of them."""
    extras = PROJECT["optional-dependencies"]
    optional = [item for name, items in extras.items() if name not in NOT_FOR_USERS for item in items]
    declared = {distribution(item) for item in [*PROJECT["dependencies"], *optional]} - {PROJECT["name"]}
    known = packages_distributions()
    others = set(imports()) - {*PACKAGES, *sys.stdlib_module_names}
    needed = {name: set(map(distribution, known[name])) for name in others}
    assert [name for name, any_of in needed.items() if not any_of & declared] == []
    assert declared - set().union(*needed.values()) == set()


def test_one_version_and_one_date():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert citation["version"] == PROJECT["version"]
    assert citation["authors"] == PROJECT["authors"]
    changes = (ROOT / "CHANGELOG.md").read_text("utf-8")
    date = re.search(rf"^## {re.escape(PROJECT['version'])} \((.*)\)$", changes, re.M)[1]
    assert date in ("unreleased", str(citation["date-released"]))


def locked(name):
    """Each line of a lock file, as far as the hashes: ``jax==0.10.2 ; python_full_version < '3.12'``."""
    text = (ROOT / name).read_text("utf-8")
    assert "//" not in text, f"{name} has the address of an index"
    entries = re.findall(r"^(\S+==.*?) \\\n    --hash=sha256:\w{64}", text, re.M)
    assert len(entries) == len(re.findall(r"^[^\s#]", text, re.M)), f"{name} has a line without a hash"
    return set(entries)


def test_the_paper_needs_a_part_of_what_is_locked_for_tests():
    run = locked("requirements.lock")
    assert run < locked("requirements-dev.lock")
    names = {distribution(entry) for entry in run}
    tests_alone = {distribution(item) for item in PROJECT["optional-dependencies"]["dev"]} - {"setuptools"}
    assert {distribution(item) for item in PROJECT["dependencies"]} | {"setuptools"} <= names
    assert not names & (tests_alone - {"equinox"}), "equinox is what optimistix needs"


@pytest.mark.parametrize(
    ("target", "lock"),
    [("paper", "requirements.lock"), *((name, "requirements-dev.lock") for name in ("env", "quick", "test", "check", "bench", "docs"))],
)  # fmt: skip
def test_a_target_installs_one_lock_file(target, lock):
    command = ["make", "--dry-run", "--always-make", target]
    printed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert set(re.findall(r"pip sync .* (\S+)", printed)) == {lock}


SYSTEMS = {"ubuntu": "POSIX :: Linux", "macos": "MacOS", "windows": "Microsoft :: Windows"}


def test_the_classifiers_name_the_systems_on_which_the_workflow_must_pass():
    """On others it runs, too, so that what fails there is known; that is no claim."""
    jobs = yaml.safe_load((ROOT / ".github" / "workflows" / "tests.yml").read_text("utf-8"))["jobs"]
    systems = {name.removesuffix("-latest") for name in jobs["commands"]["strategy"]["matrix"]["os"]}
    assert jobs["commands"]["continue-on-error"] == "${{ matrix.os != 'ubuntu-latest' }}"
    required = {name for name in systems if name == "ubuntu"}
    stated = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["classifiers"]
    assert {f"Operating System :: {SYSTEMS[name]}" for name in required} == {
        text for text in stated if text.startswith("Operating System")
    }
