"""Declared tables: values by their types; every mistake is one line that names its key as the file does."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import pytest

from rig.exceptions import RigError
from rig.record.rig_file import load_rig
from rig.toml_tables import TomlError, TomlTable, WrongKeyError, parse_toml, read_table, written


def half(path, raw):
    if raw == "half":
        return 0.5
    raise ValueError(f"is {raw!r}: write half")


class Disc(TomlTable, frozen=True, kw_only=True, tag_field="shape", tag="disc"):
    radius: float


class Bar(TomlTable, frozen=True, kw_only=True, tag_field="shape", tag="bar"):
    name: str
    ends: tuple[float, float] = (0.0, 1.0)

    def __post_init__(self):
        if self.ends[0] > self.ends[1]:
            raise WrongKeyError("ends", "write the lower first")


class File(TomlTable, frozen=True, kw_only=True):
    count: int
    title: str | None = None
    sign: Literal["plus", "minus"] = "plus"
    share: Annotated[float, written(half, {"const": "half"})] | None = None
    level: Annotated[float, msgspec.Meta(ge=1, le=10)] = 2.0
    on: bool = False
    part: tuple[Disc | Bar, ...] = ()
    by_name: Mapping[str, Disc] = {}
    size: float | tuple[float, float, float] = 0.0

    def __post_init__(self):
        if self.on and self.title is None:
            raise WrongKeyError("title", "say what is on")
        if self.count == 13:
            raise WrongKeyError("", "brings bad luck")


def test_values():
    parts = [{"shape": "bar", "name": "b"}, {"shape": "disc", "radius": 2}]
    file = read_table("", {"count": 3, "share": "half", "part": parts, "by_name": {"x": {"shape": "disc", "radius": 1}},
                           "size": [1, 2, 3]}, File)  # fmt: skip
    assert (file.count, file.share, file.part[0].ends, file.by_name["x"].radius) == (3, 0.5, (0, 1), 1)
    assert (file.size, read_table("", {"count": 0, "size": 4}, File).size) == ((1, 2, 3), 4)
    assert isinstance(file.part[1].radius, float)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"count": None}, "missing key f.count: add it"),
        ({"count": True}, "f.count is True: write a whole number"),
        ({"count": 1.5}, "f.count is 1.5: write a whole number"),
        ({"count": 10**9}, "f.count is out of range: write a smaller number"),
        ({"size": 10**400}, "f.size is 1.*: write a finite number"),
        ({"size": math.inf}, "f.size is inf: write a finite number"),
        ({"size": [1, math.nan, 2]}, r"f.size\[1\] is nan: write a finite number"),
        ({"size": [1, 2]}, r"f.size is \[1, 2\]: write three values, one per axis"),
        ({"title": 3}, "f.title is 3: write a string"),
        ({"sign": "both"}, "f.sign is 'both': choose one of plus, minus"),
        ({"share": "most"}, "f.share is 'most': write half"),
        ({"level": 11}, "f.level is 11: write a number from 1 to 10"),
        ({"on": 1}, "f.on is 1: write true or false"),
        ({"on": True}, "missing key f.title: say what is on"),
        ({"count": 13}, "f brings bad luck"),
        ({"colour": "red"}, "unknown key f.colour: the keys here are by_name, count, level"),
        ({"part": {}}, r"f.part is a table: write \[\[f.part\]\], one for each"),
        ({"part": [{"radius": 1}]}, r"missing key f.part\[0\].shape: add it"),
        ({"part": [{"shape": "cone"}]}, r"f.part\[0\].shape is 'cone': choose one of disc, bar"),
        ({"part": ["bar"]}, r"f.part\[0\] is 'bar': write a table"),
        ({"part": [{"shape": "bar", "name": "b", "ends": [2, 1]}]}, r"f.part\[b\].ends is \[2, 1\]: write the lower first"),
        ({"part": [{"shape": "disc", "radius": 1, "name": "d"}]}, r"unknown key f.part\[d\].name: the keys here are rad"),
        ({"by_name": {"x": {"radius": "1"}}}, "f.by_name.x.radius is '1': write a finite number"),
        ({"by_name": []}, r"f.by_name is \[\]: write a table"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_that_names_its_key(changed, message):
    content = {key: value for key, value in ({"count": 1} | changed).items() if value is not None}
    with pytest.raises(TomlError, match=f"^{message}") as caught:
        read_table("f", content, File)
    assert "\n" not in str(caught.value)


def test_what_is_no_table():
    with pytest.raises(TomlError, match=r"^f is \[\]: write a table"):
        read_table("f", [], File)


DEEP = ".".join("a" * 17)
DEEP_KEYS = {
    "a key": f"{DEEP} = 1",
    "with blanks and quotes": "b = 1\n" + " . ".join(["a", '"b.\\"c"', "'d.e'"] * 6) + " = 1",
    "a table": f"[{DEEP}]",
    "a list of tables": f"[[{DEEP}]]",
    "in a table": f"x = {{a = 1, {DEEP} = 1}}",
    "after a text with quotes at its end": f'x = {{a = """b"""", {DEEP} = 1}}',
    "after texts of several lines": f'x = \'\'\'\n"""\'\'\'\ny = """\n#\\""""\n{DEEP} = 1',
    "after a comment": f"# it's\n{DEEP} = 1",
}


@pytest.mark.parametrize("text", DEEP_KEYS.values(), ids=DEEP_KEYS)
def test_a_key_of_many_parts_is_refused_before_it_takes_memory(text):
    with pytest.raises(TomlError, match=r"^a key of more than 16 parts \(at line \d\)$"):
        parse_toml(text.encode())


SHALLOW = {
    "as many as may be": f"{DEEP[2:]} = 1",
    "a comment": f"a = 1 # {DEEP}",
    "a text": f'a = "{DEEP}"',
    "another text": f"a = '{DEEP}'",
    "a text of several lines": f'a = """\n{DEEP}"""',
    "another of several lines": f"a = '''\n{DEEP}'''",
    "numbers": f"a = [{'1.5, ' * 100}2.5, 1979-05-27T07:32:00.5]",
    "keys one after the other": "\n".join(f"a.b.c{k} = 0.1" for k in range(100)),
}


@pytest.mark.parametrize("text", SHALLOW.values(), ids=SHALLOW)
def test_dots_elsewhere_are_no_parts_of_a_key(text):
    assert "a" in parse_toml(text.encode())


ENDLESS = [
    "a" * 10**6, "a." * 15 + "a" * 10**6, '"\\"' * 10**5, '"' * 10**5, "'" * 10**5, '"""\\' * 10**5, '"""\\\n' * 10**5,
    "'''\n" * 10**5 + "x", " " * 10**6, "a" + " " * 10**6, "#" * 10**6, ("a . " * 16 + "= ") * 10**4,
]  # fmt: skip


@pytest.mark.parametrize("text", ENDLESS, ids=range(len(ENDLESS)))
def test_a_text_that_is_no_toml_is_refused_at_once(text):
    """The search for deep keys takes time with the text's length, not with its square."""
    with pytest.raises(TomlError):
        parse_toml(f"{text}\n=".encode())


def test_a_file_that_would_fill_the_memory_is_not_read(tmp_path):
    (tmp_path / "rig.toml").write_bytes(b"#" * (2**22 + 1))
    with pytest.raises(RigError, match=r"^not a TOML file .*rig.toml \(over 4 MiB\)"):
        load_rig(tmp_path / "rig.toml")


def test_every_file_is_read_within_these_limits():
    """Elsewhere is read what is part of the program, or what it has written itself."""
    root = Path(__file__).parents[2]
    sources = {
        path.relative_to(root).as_posix(): path
        for name in ("identify", "rig", "uq")
        for path in (root / name).rglob("*.py")
    }
    assert {name for name, path in sources.items() if "tomllib.load" in path.read_text("utf-8")} == {
        "rig/toml_tables.py", "uq/experiment/platform_table.py", "uq/files/toml_text.py", "uq/report/input_tables.py",
        "uq/runs/tables/proposed_map.py",
    }  # fmt: skip
