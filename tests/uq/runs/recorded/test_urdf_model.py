"""URDF files that would keep a library busy for long, or end the process: each is one line, before any library reads it."""

from pathlib import Path

import pytest

from uq.cli.main import main
from uq.files.mistakes import ExperimentError
from uq.runs.recorded.urdf_model import DEEPEST, LARGEST, MOST_LINKS, MOST_NESTED, urdf_model, urdf_text

EXPERIMENTS = Path(__file__).parents[4] / "uq" / "examples"
LIMITS = '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'


def joint(k, parent, child):
    ends = f'<parent link="link_{parent}"/><child link="link_{child}"/>'
    return f'<joint name="joint_{k}" type="revolute">{ends}<origin xyz="0 0 0.1"/>{LIMITS}</joint>'


def robot(pairs, count, more=""):
    links = "".join(f'<link name="link_{k}"/>' for k in range(count))
    return f'<robot name="r">{more}{links}{"".join(joint(k, *pair) for k, pair in enumerate(pairs))}</robot>'


def chain(count):
    return robot([(k, k + 1) for k in range(count - 1)], count)


def star(count):
    return robot([(0, k) for k in range(1, count)], count)


ENTITIES = "".join(f'<!ENTITY e{k} "{f"&e{k - 1};" * 10}">' for k in range(1, 10))
BOMB = f'<?xml version="1.0"?><!DOCTYPE robot [<!ENTITY e0 "x">{ENTITIES}]>{robot([], 1, "&e9;")}'
FILE = '<!DOCTYPE robot [<!ENTITY file SYSTEM "file:///etc/passwd">]><robot name="&file;"/>'
BAD = {
    "chain of 500": (chain(500), f"over {DEEPEST} links in a chain in arm.urdf at platform.urdf"),
    "chain of 5,000": (chain(5000), f"5000 links in arm.urdf at platform.urdf: leave {MOST_LINKS} at most"),
    "star of 5,000": (star(5000), "5000 links"),
    "circle": (robot([(0, 1), (1, 2), (2, 0)], 3), "or in a circle"),
    "joints that no link declares": (robot([(k, k + 1) for k in range(5000)], 1), f"over {DEEPEST} links"),
    "ladder": (robot([(k // 2, k // 2 + 1) for k in range(60)], 31), "two joints of .* move link 'link_1'"),
    "entities": (BOMB, "a document type .* in arm.urdf at platform.urdf: remove it"),
    "an entity of a file": (FILE, "a document type"),
    "elements in elements": ("<robot>" + "<a>" * 10**5, f"over {MOST_NESTED} elements inside one another"),
    "elements in a link": (robot([], 1, "<gazebo>" + "<a>" * 200 + "</a>" * 200 + "</gazebo>"), f"over {MOST_NESTED} elem"),
    "not ended": ("<robot>", "no URDF .*arm.urdf at platform.urdf"),
    "nothing": ("", "no URDF .*arm.urdf at platform.urdf"),
    "too large": (" " * (LARGEST + 1), f"has over {LARGEST >> 20} MiB"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_urdf_that_is_too_much_is_one_line(name, tmp_path, capsys):
    text, message = BAD[name]
    (tmp_path / "arm.urdf").write_text(text)
    with pytest.raises(ExperimentError, match=message):
        urdf_text(str(tmp_path / "arm.urdf"), "platform.urdf")
    (tmp_path / "arm.toml").write_text((EXPERIMENTS / "arm.toml").read_text())
    assert main(["design", str(tmp_path / "arm.toml")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")


def test_what_is_no_file_is_not_opened(tmp_path):
    with pytest.raises(ExperimentError, match=r"no file .*gone\.urdf"):
        urdf_text(str(tmp_path / "gone.urdf"), "recording.urdf")
    with pytest.raises(ValueError, match=r"not a file .* but a folder"):
        urdf_text(str(tmp_path), "recording.urdf")


@pytest.mark.parametrize(("text", "joints"), [(chain(DEEPEST), DEEPEST - 1), (star(MOST_LINKS), MOST_LINKS - 1)])
def test_as_much_as_a_limit_is_read(text, joints, tmp_path):
    pytest.importorskip("pinocchio")
    (tmp_path / "r.urdf").write_text(f'\ufeff\n<?xml version="1.0"?>{text}')
    model = urdf_model(str(tmp_path / "r.urdf"), "recording.urdf", "joint states")
    assert model.njoints == joints + 1
