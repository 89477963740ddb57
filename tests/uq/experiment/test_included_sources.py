"""``include``: the sources of other files are those of the experiment; what else they hold, or lack, is one line."""

from pathlib import Path

import pytest

from uq.experiment.experiment import Experiment, ExperimentError

TEXT = (Path(__file__).parents[3] / "uq" / "examples" / "t1-10s.toml").read_text()
WITHOUT, _, SOURCES = TEXT.partition("[[source]]")
SOURCES = "[[source]]" + SOURCES.partition("[recording]")[0]
FIRST, *OTHERS = [f"[[source]]{part}" for part in SOURCES.split("[[source]]")[1:]]


def experiment(folder, include, text=WITHOUT):
    (folder / "e.toml").write_text(f"include = {include}\n{text}")
    return folder / "e.toml"


def test_included_sources_are_those_of_one_file(tmp_path):
    (tmp_path / "more").mkdir()
    (tmp_path / "first.toml").write_text(FIRST)
    (tmp_path / "more" / "others.toml").write_text("".join(OTHERS))
    whole = Experiment.from_dict({**Experiment.load(experiment(tmp_path, "[]", WITHOUT + SOURCES)).document})
    parted = Experiment.load(experiment(tmp_path, '["first.toml", "more/others.toml"]'))
    assert parted.inputs()["resolved"] == whole.inputs()["resolved"]
    assert parted.with_source("F_precision", sigma="1 N").sources[0].sigma[0] == 1  # as if it stood in the file


def test_files_of_samples_are_beside_the_file_that_names_them(tmp_path):
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "s.csv").write_text("1\n2\n3\n4\n")
    source = '[[source]]\nname = "a"\ntarget = "gravity"\nkind = "bias"\ndistribution = "samples"\nsamples = "s.csv"\nunit = "mm/s^2"\ngroup = "b"\n'
    (tmp_path / "more" / "s.toml").write_text(source)
    assert [s.name for s in Experiment.load(experiment(tmp_path, '["more/s.toml"]')).sources] == ["a"]


@pytest.mark.parametrize(
    ("include", "file", "said"),
    [
        ('["none.toml"]', "", "no file 'none.toml', which include names"),
        ('"s.toml"', FIRST, r'include is .s.toml.: write a list of files, include = \["sources.toml"\]'),
        ("[1]", FIRST, "include is .*: write a list of files"),
        ('["s.toml"]', "x = [", "not TOML .*s.toml"),
        ('["s.toml"]', "", r"s.toml holds no \[\[source\]\]"),
        ('["s.toml"]', "source = 1", r"s.toml holds no \[\[source\]\]"),
        ('["s.toml"]', '[body]\nmass = "1 kg"\n' + FIRST, "s.toml holds body: a file that include names holds"),
        ('["s.toml", "s.toml"]', FIRST, "source 'F_precision' is declared twice, in s.toml and in s.toml: keep one"),
        ('["s.toml", "s.toml"]', '[[source]]\nname = [1]', "source '.1.' is declared twice, in s.toml and in s.toml"),
        ('["."]', FIRST, "no file '.', which include names"),
        ('["s.toml"]', FIRST.replace("sigma", "sigmas"), r"unknown key source\[F_precision\].sigmas"),
    ],
)  # fmt: skip
def test_mistakes_are_one_line(tmp_path, include, file, said):
    (tmp_path / "s.toml").write_text(file)
    with pytest.raises(ExperimentError, match=said) as caught:
        Experiment.load(experiment(tmp_path, include))
    assert "\n" not in str(caught.value)


def test_a_source_of_the_experiment_and_of_a_file(tmp_path):
    (tmp_path / "s.toml").write_text(FIRST)
    with pytest.raises(ExperimentError, match="declared twice, in the experiment and in"):
        Experiment.load(experiment(tmp_path, '["s.toml"]', WITHOUT + SOURCES))
