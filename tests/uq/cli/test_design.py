"""The report of a design, its files, the command and its options; the search itself is tested elsewhere."""

import contextlib
import dataclasses
import io
import json
import re
import shutil
import tomllib
from xml.etree import ElementTree

import jax.numpy as jnp
import matplotlib.image
import numpy as np
import pytest

import uq.cli.design as command
from identify.motion.limit_peaks import Peak
from identify.motion.multisine import Multisine
from identify.rigid_body.inertia import Body
from identify.rigid_body.principal_axes import principal
from tests.helpers.browser import Reader, drawn
from tests.helpers.driven_browser import Browser, needs_axe, needs_chromium
from uq.cli.main import main
from uq.experiment.experiment import Experiment, ExperimentError
from uq.files.toml_text import toml_text
from uq.plan.motion_design.hexapod.design import Design, Start
from uq.plan.motion_design.hexapod.design_bound import DesignBound
from uq.plan.motion_design.hexapod.design_report import design_report
from uq.plan.motion_design.hexapod.designed_experiment import designed_files, trajectory_table
from uq.plan.motion_design.hexapod.reference_trajectory import PredictedTrajectory
from uq.report.figures.platform_scene import cuboid

pytestmark = pytest.mark.usefixtures("results_follow_their_schema")

SECONDS = 20.0
LIMITS = {
    "length": ["0.45 m", "0.7 m"], "speed": "1 m/s", "acceleration": "9 m/s^2", "force": "500 N", "bandwidth": "2 Hz",
}  # fmt: skip
BOUND = DesignBound(1e-3, 0.5e-3, ("ramps take no time",))


def document(preset):
    """The preset on a platform, T1 and T2 alone, of twenty seconds at 100 Hz."""
    short = {"duration": f"{SECONDS:g} s", "ramp": "3 s", "rate": "100 Hz", "precessions": 1}
    content = dict(preset.document)
    content["trajectory"] = {name: {**content["trajectory"][name], **short} for name in ("T1", "T2")}
    content["platform"] = {
        **content["platform"], "geometry": "assumed-source-size", "limits": LIMITS,
    }  # fmt: skip
    return content


@pytest.fixture(scope="module")
def design(preset):
    """A motion as a search might find it."""
    experiment = Experiment.from_dict(document(preset))
    given = experiment.trajectories["T1"]
    amplitudes = np.random.default_rng(2).normal(size=(2, 6, 3)) * np.repeat([0.001, 0.02], 3)[:, None]
    motion = Multisine(np.array([0.6, 1.0, 1.6]), *amplitudes, np.array(SECONDS), np.array(3.0))
    spec = dataclasses.replace(given, still="omb", trajectory=motion)
    used = [Peak(name, share, 0, "leg 1", 9.0) for name, share in zip(("speed", "force"), (0.98, 0.4), strict=True)]
    reference = PredictedTrajectory(given, np.full(6, -2e-4), (2e-3 / 3) ** 2 * np.eye(6))
    return Design(
        spec=spec, mean_error=np.full(6, -1e-4), covariance=(1e-3 / 3) ** 2 * np.eye(6), experiment=experiment,
        reference=reference, limits=experiment.limits.figures, bound=BOUND, peaks=used, starts=[Start(0.7, 0.0, 9)], band=2.0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def ran(design, preset, tmp_path_factory):
    """One run of the command, the search apart: what it was asked, its report, its files and what it printed."""
    folder, kept, said = tmp_path_factory.mktemp("design"), {}, io.StringIO()

    def found(experiment, **given):
        kept["asked"] = {name: value for name, value in given.items() if name != "progress"}
        return dataclasses.replace(design, experiment=experiment)

    def reported(*operands, **given):
        kept["report"] = design_report(*operands, **given)
        return kept["report"]

    (folder / "e.toml").write_text(toml_text(document(preset)))
    options = [
        "--goal",
        "moments",
        "--objective",
        "rms",
        "--starts",
        "2",
        "--seed",
        "3",
        "--duration",
        "20 s",
        "--period",
        "4 s",
        "--target",
        "1e-3 g*m^2",
    ]
    more = ["--rehearsal", "1", "--rehearsal-amplitude", "0.8", "--poses", "3"]
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(said):
        patch.setattr(command, "design", found)
        patch.setattr(command, "design_report", reported)
        assert main(["design", str(folder / "e.toml"), "--out", str(folder / "out"), *options, *more]) == 0
    files = {path.name: path.read_bytes() for path in (folder / "out").iterdir()}
    return kept["asked"], kept["report"], files, said.getvalue()


@pytest.fixture(scope="module")
def report(ran):
    return ran[1]


@pytest.fixture(scope="module")
def content(ran):
    return ran[2]


def test_everything_is_written(content):
    names = set(content)
    assert {"result.json", "report.html", "designed.toml", "designed.csv", "poses.csv", "motion.csv"} <= names
    assert {"motion.pi.txt", "motion.moog.bin", "motion.json", "platform.svg", "platform.png", "legs.svg"} <= names


@needs_chromium
@needs_axe
def test_axe_core_objects_to_nothing(content, tmp_path):
    with Browser(tmp_path, content["report.html"].decode()) as browser:
        browser.unfold()
        assert browser.violations_on_screens() == {}


def test_the_designed_file_holds_the_designed_motion(content, design, tmp_path):
    for name in ("designed.toml", "designed.csv"):
        (tmp_path / name).write_bytes(content[name])
    found = Experiment.load(tmp_path / "designed.toml")
    assert list(found.trajectories) == ["T1", "T2", "designed"]
    spec = found.trajectories["designed"]
    assert (spec.duration, spec.rate, spec.still) == (design.spec.duration, design.spec.rate, "omb")
    for name in ("frequency", "cosine", "sine", "duration", "ramp"):
        np.testing.assert_array_equal(getattr(spec.trajectory, name), getattr(design.spec.trajectory, name))
    assert found.estimator().band == 2.0
    assert found.poses.attitude == "gravity"
    others = {k: v for k, v in found.document.items() if k not in ("trajectory", "estimator", "recording", "poses")}
    assert others == {k: v for k, v in design.experiment.document.items() if k in others}


@pytest.mark.slow
def test_the_monte_carlo_runs_it_as_it_is(content, report, tmp_path, capsys):
    """200 trials: a 3σ has a standard error of 5 %; six of them, and mean errors, within four and a half (8e-5)."""
    for name in ("designed.toml", "designed.csv"):
        (tmp_path / name).write_bytes(content[name])
    run = ["montecarlo", str(tmp_path / "designed.toml"), "--trajectory", "designed", "--trials", "200"]
    assert main([*run, "--out", str(tmp_path / "mc")]) == 0
    said = json.loads((tmp_path / "mc" / "result.json").read_text())["trajectories"]["designed"]["designed"]
    got = said["groups"]["total"]
    ours = report.laws["designed"].total.to_dict()
    for statistic in ("three_sigma", "mean_error"):
        for name, value in got[statistic].items():
            assert abs(value - ours[statistic][name]) < 4.5 * got[f"{statistic}_standard_error"][name]


def test_the_figures_in_json_are_the_laws(content, report):
    said = json.loads(content["result.json"])
    assert said["unit"] == "g*m^2"
    total = said["trajectories"]["designed"]["groups"]["total"]["three_sigma"]
    assert total["I11"] == pytest.approx(1e3 * report.laws["designed"].total.three_sigma[0])
    assert set(said["trajectories"]) == {"designed", "reference", "T1", "T2"}
    assert said["durations"][0]["forbids"] == "r_cg"
    assert said["poses"]["file"] == "poses.csv"
    assert said["motion"]["files"] == ["motion.csv", "motion.pi.txt", "motion.moog.bin", "motion.json"]
    assert said["limits"][0]["share"] >= said["limits"][-1]["share"]


def test_the_mean_error_stands_beside_the_dispersion(content, report):
    """In JSON and table, of every trajectory and component; 3 rms is 3√(σ² + b²)."""
    said = json.loads(content["result.json"])
    assert said["objective"] == "rms"
    assert said["promised_mean_error"]["I11"] == pytest.approx(-0.1)
    assert {"components.svg", "components.png"} <= set(content)
    rows = report.tables()[0].rows
    for name, law in report.laws.items():
        at = [row[0] for row in rows].index(name)
        figures = [[float(cell.replace("−", "-")) for cell in row[3:9]] for row in rows[at : at + 3]]
        sigma, mean, rms = np.array(figures)
        np.testing.assert_allclose(mean, 1e3 * law.total.mean_error, atol=0.0051)  # two decimals, common to the row
        np.testing.assert_allclose(rms**2, sigma**2 + (3 * mean) ** 2, rtol=0.02)
        got = said["trajectories"][name]
        assert got["groups"]["total"]["mean_error"]["I33"] == pytest.approx(1e3 * law.total.mean_error[5])
        assert got["average_three_rms"]["products"] == pytest.approx(np.mean(1e3 * law.total.three_rms[[1, 2, 4]]))


@pytest.mark.parametrize(("objective", "cure"), [("rms", ""), ("3sigma", " The objective rms designs against it.")])
def test_a_mean_error_beyond_3_sigma_is_a_warning(report, objective, cure):
    laws = dict(report.laws)
    total, noise = laws["designed"].total, laws["designed"].sources["omega_precision"]
    far = dataclasses.replace(total, mean_error=total.three_sigma * [0.99, 0, 0, 0, 0, -2])
    sources = {**laws["designed"].sources, "omega_precision": dataclasses.replace(noise, mean_error=far.mean_error)}
    laws["designed"] = dataclasses.replace(laws["designed"], groups={"total": far}, sources=sources)
    changed = dataclasses.replace(report, laws=laws, design=dataclasses.replace(report.design, objective=objective))
    first, second = changed.warnings
    assert re.fullmatch(r"designed: the mean error exceeds 3σ: I33 −[\d.]+ g·m² \(2\.00 × 3σ\)\.", first)
    assert second == f"Most of the mean error is that of omega precision, which a longer run does not reduce.{cure}"
    assert changed.to_dict()["warnings"] == list(changed.section().findings[:2]) == [first, second]
    assert changed.notes() == [f"attention: {first}", f"attention: {second}", *report.sensors.notes()]
    quiet = {name: dataclasses.replace(law, groups={"total": total}) for name, law in laws.items()}
    assert dataclasses.replace(report, laws=quiet).warnings == []


def test_the_report_says_what_was_asked(content, report):
    text = " ".join(Reader(content["report.html"].decode()).text)
    for words in ("What each limit is used to", "Which sensor should I buy?", "How long must I measure?",
                  "out of reach: r cg", "Static poses to run", "Exported motion", "Average 3σ of the moments"):  # fmt: skip
        assert words in text, words
    assert text.count("change, %") >= 3
    assert "No motion under these limits can have a 3σ below 1.00 g·m² (moments) and 0.500 g·m² (products)." in text
    assert "The bound leaves out: ramps take no time." in text
    assert report.tables()[0].rows[-1][0] == "bound"


def test_what_undeclared_errors_leave_is_said(report):
    """The preset declares that there are none."""
    assert "Undeclared" not in report.title()
    growth = dataclasses.replace(report.durations[0].growth, undeclared=(np.array([1, 2, 2, 3, 2, 5]) * 1e-3 / 3) ** 2)
    durations = tuple(dataclasses.replace(duration, growth=growth) for duration in report.durations)
    title = dataclasses.replace(report, durations=durations).title()
    line = (
        "Undeclared errors at typical size have an average 3σ of 3.00 g·m² (moments) and 2.00 g·m² (products), at any"
    )
    assert line in title


def test_where_a_constant_source_rules_the_bound_is_no_promise(report):
    """r_cg a hundred times as large: what counts the cell's noise alone says little, and is set against nothing."""
    law = report.laws["designed"]
    assert report.noise_share("moments") == pytest.approx(
        sum(np.diag(law.sources[name].covariance)[[0, 3, 5]].sum() for name in ("F_precision", "M_precision"))
        / np.diag(law.total.covariance)[[0, 3, 5]].sum()
    )  # fmt: skip
    large = dataclasses.replace(law.sources["r_cg"], covariance=np.eye(6))
    total = dataclasses.replace(law.total, covariance=law.total.covariance + np.eye(6))
    changed = dataclasses.replace(law, groups={**law.groups, "total": total}, sources={**law.sources, "r_cg": large})
    ruled = dataclasses.replace(report, laws={**report.laws, "designed": changed})
    said = ruled.title()
    assert (
        "The bound of the moments, 1.00 g·m², counts the load cell's noise alone, but r cg makes 100 % of the variance"
        in said
    )
    assert "No motion" not in said
    assert ruled.tables()[0].rows[-1][-4:] == ["1.00", "", "0.500", ""]


def test_the_page_loads_nothing_and_its_platform_moves(content):
    html = content["report.html"].decode()
    page = Reader(html)
    assert not {"script", "link", "iframe", "object"} & set(page.tags)
    assert not page.values("src")
    root = ElementTree.fromstring(content["platform.svg"])
    moves = [node for node in root.iter() if node.tag.endswith("animate")]
    assert {node.get("attributeName") for node in moves} == {"d", "cx", "cy"}
    counts = {len(node.get("values").split(";")) for node in moves}
    assert len(counts) == 1
    assert counts.pop() > 50
    first = moves[0].get("values").split(";")
    assert first[0] != first[len(first) // 2]
    assert html.count("<animate ") == len(moves)
    assert html.index('class="picture still"') < html.index('class="picture moving"') < html.index("<animate ")


def test_the_drawn_cuboid_has_the_bodys_tensor():
    """A solid cuboid's principal moments, from its corners: m/12 of the sum of squares of two edges."""
    body = Body(jnp.array(5.0), jnp.zeros(3), jnp.array([0.3, 0.02, -0.01, 0.2, 0.03, 0.35]))
    corners = cuboid(body)
    square = np.array([np.sum((corners[0] - corners[k]) ** 2) for k in (1, 2, 4)])
    moments = 5.0 / 12 * (square.sum() - square)
    np.testing.assert_allclose(np.sort(moments), np.sort(principal(body.inertia)[0]), rtol=1e-6)


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs Chromium")
def test_a_browser_draws_and_prints_it(content, tmp_path):
    picture, printed, complaints = drawn(content["report.html"].decode(), tmp_path)
    assert complaints == []
    pixels = matplotlib.image.imread(picture)[..., :3]
    assert pixels.std() > 0.05
    assert printed.read_bytes().startswith(b"%PDF")


def test_the_command_asks_for_what_it_was_told(ran):
    asked, _, files, said = ran
    assert asked == {"goal": "moments", "objective": "rms", "starts": 2, "seed": 3, "duration": 20.0, "period": 4.0}
    assert {"rehearsal.csv", "rehearsal.pi.txt", "rehearsal.moog.bin"} <= set(files)
    about = json.loads(files["rehearsal.json"])
    assert (about["speed"], about["amplitude"]) == (1.0, 0.8)
    assert "Average 3σ of the moments" in said
    assert "result.json, report.html" in said


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--rehearsal", "0"], "--rehearsal is 0: give a part above 0 and at most 1"),
        (["--rehearsal", "nan"], "--rehearsal is nan: give a part"),
        (["--rehearsal-amplitude", "2"], "--rehearsal-amplitude is 2"),
        (["--rehearsal", "fast"], "invalid float value: 'fast'"),
        (["--duration", "180"], "--duration is '180': write a number, a space and a unit"),
        (["--duration", "-1 s"], "--duration is '-1 s': give a value above zero"),
        (["--period", "5"], "--period is '5': write a number, a space and a unit"),
        (["--period", "0 s"], "--period is '0 s': give a value above zero"),
        (["--period", "10 ms"], "period is 0.01 s: give 2 / bandwidth or more"),
        (["--period", "100 s"], "motions of period 100 s take 400 s or more"),
        (["--target", "1 N"], "--target is '1 N': write a unit of the same dimension as kg*m^2"),
        (["--poses", "2"], "--poses is 2: ask for three or more"),
        (["--poses", "few"], "'few' is not a whole number"),
        (["--starts", "0"], "0 starts"),
        (["--goal", "everything"], "unknown goal"),
        (["--objective", "bias"], "unknown objective 'bias': choose one of rms, 3sigma"),
        (["--reference", "T9"], "unknown trajectory 'T9'"),
    ],
)
def test_bad_options(preset, tmp_path, capsys, options, message):
    (tmp_path / "e.toml").write_text(toml_text(document(preset)))
    try:
        status = main(["design", str(tmp_path / "e.toml"), "--out", str(tmp_path / "out"), *options])
    except SystemExit as error:
        status = error.code
    said = capsys.readouterr().err
    assert status == 2
    assert message in said
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_rate_too_low_is_refused_before_the_search(preset, tmp_path, capsys):
    content = document(preset)
    content["platform"]["limits"] = {**LIMITS, "bandwidth": "5 Hz"}
    (tmp_path / "e.toml").write_text(toml_text(content))
    assert main(["design", str(tmp_path / "e.toml")]) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: trajectory.T1.rate is 100 Hz, too low to differentiate a motion of 5 Hz: raise it")
    assert said.count("\n") == 1


# --- the files ---


def test_what_cannot_stand_in_a_file(design, preset):
    with pytest.raises(ExperimentError, match="is of no file"):
        designed_files(dataclasses.replace(design.experiment, document={}), design.spec, 2.0)
    for name in ("T1", "T3"):
        spec = preset.trajectories[name]
        written = {**preset.document, "trajectory": {"again": trajectory_table(spec)}}
        again = Experiment.from_dict(written).trajectories["again"]
        assert again.trajectory.angular_acceleration == spec.trajectory.angular_acceleration
        assert (again.duration, again.rate, again.still) == (spec.duration, spec.rate, spec.still)


def test_files_that_the_experiment_names_come_along(design, preset, tmp_path):
    (tmp_path / "noise").mkdir()
    (tmp_path / "noise" / "cg.csv").write_text("1e-4,1e-4,1e-4\n2e-4,1e-4,0\n0,1e-4,1e-4\n")
    content = document(preset)
    source = {"name": "more", "target": "r_cg", "kind": "bias", "group": "cg", "distribution": "samples",
              "samples": "noise/cg.csv", "unit": "m"}  # fmt: skip
    content["source"] = [*content["source"], source]
    experiment = Experiment.from_dict(content, tmp_path)
    made = designed_files(experiment, design.spec, 2.0)
    assert made["cg.csv"] == (tmp_path / "noise" / "cg.csv").read_bytes()
    assert tomllib.loads(made["designed.toml"].decode())["source"][-1]["samples"] == "cg.csv"
    twice = {**content, "recording": {"urdf": "other/cg.csv", "urdf_frame": "tool"}}
    with pytest.raises(ExperimentError, match=r"two files are named cg\.csv"):
        designed_files(Experiment.from_dict(twice, tmp_path), design.spec, 2.0)


def test_any_toml_comes_back():
    import datetime

    content = {
        "a b": 'quo"te\\ \n\x7f é', "n": [1, -2.5, True], "day": datetime.date(2026, 3, 31), "empty": {},
        "t": {"u": {"v": [{"w": 1}, {"w": 2, "x": {"y": "z"}}]}, "inline": [[{"k": 1}], []]},
    }  # fmt: skip
    assert tomllib.loads(toml_text(content)) == content
    with pytest.raises(ValueError, match="no place in TOML"):
        toml_text({"x": None})


def test_the_overview_names_the_command(capsys):
    assert main(["--help"]) == 0
    assert re.search(r"design\s+the best trajectory", capsys.readouterr().out)
