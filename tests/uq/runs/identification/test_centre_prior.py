"""``inertia identify --centre``, ``--tare``, ``[datum]`` and ``[scale]``: what they do to the result, and bad input."""

import dataclasses
import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.estimation.static_poses.centre_result import Centre
from identify.identification import identify
from identify.rigid_body.inertial_parameters import InertialParameters
from tests.helpers.commands import SHORT, refused
from tests.helpers.recordings import Signals, declare, write
from tests.helpers.report_tables import T1
from tests.helpers.tare_lab import FIXTURE, WHOLE, experiment_of
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.simulation import simulate
from uq.runs.identification.identify_files import identify_files
from uq.runs.identification.tare import tare_files

pytestmark = pytest.mark.usefixtures("undrawn", "unjudged")

POSES = SHORT + "\n[poses]\n"


def centre_of(parameters, sigma=(1e-3, 1e-4, 2e-4, 3e-4)):
    """A centre of a body that is known, with correlated uncertainty of mass [kg] and centre of gravity [m]."""
    root = np.diag([*sigma, *[1e-2] * 3, *[1e-3] * 3]) @ np.linalg.cholesky(0.6 * np.eye(10) + 0.4)
    return Centre(
        parameters.mass, parameters.r_cg, np.zeros(3), np.zeros(3), root @ root.T, np.zeros((12, 6)), np.inf, 9.80665,
        provenance={"inputs": [{"file": "poses.csv", "sha256": "ab"}]},
    )  # fmt: skip


def saved(path, centre):
    path.write_text(json.dumps(centre.to_dict()))
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("tare")


@pytest.fixture(scope="module")
def files(folder, short):
    """Runs of the body on its fixture and of the fixture, and the two centres."""
    for name, parameters in (("whole", WHOLE), ("empty", FIXTURE)):
        write(folder / f"{name}.mcap", Signals.of(simulate(experiment_of(short, parameters), "T1")))
        saved(folder / f"{name}.json", centre_of(parameters))
    (folder / "e.toml").write_text(POSES)
    return folder


@pytest.fixture(scope="module")
def plain(files, short):
    whole = dataclasses.replace(declare(short), r_cg_from_q=None, mass=None)
    return identify_files([files / "whole.mcap"], whole, centre=files / "whole.json")


def test_the_centres_covariance_goes_into_the_tensor_in_full(short, files, plain):
    """The tensor is linear in r: its covariance is B V Bᵀ with B by differences, V with its correlations."""
    run = simulate(experiment_of(short, WHOLE), "T1").run
    estimator = short.estimator("smoothed")
    exact = identify(run, r_cg=WHOLE.r_cg, estimator=estimator)
    known = identify(run, centre=centre_of(WHOLE), estimator=estimator)
    h = 1e-4
    by = np.array([identify(run, r_cg=WHOLE.r_cg + h * e, estimator=estimator).inertia for e in np.eye(3)]).T
    by = (by - exact.inertia[:, None]) / h
    spread = centre_of(WHOLE).covariance
    np.testing.assert_allclose(known.inertia, exact.inertia, rtol=1e-12)
    np.testing.assert_allclose(known.covariance - exact.covariance, by @ spread[1:4, 1:4] @ by.T, rtol=1e-6, atol=1e-18)
    covariance = known.parameters.covariance
    np.testing.assert_allclose(covariance[:4, :4], spread[:4, :4], rtol=1e-12)
    np.testing.assert_allclose(covariance[4:, 1:4], by @ spread[1:4, 1:4], rtol=1e-6, atol=1e-15)
    np.testing.assert_allclose(covariance[4:, 0], by @ spread[1:4, 0], rtol=1e-6, atol=1e-15)
    assert (np.diff(known.interval95, axis=1) > np.diff(exact.interval95, axis=1)).all()
    content = plain.to_dict()
    assert content["mass"].pop("conventional_bound") == content["mass"]["interval95"]
    factor = centre_of(WHOLE).coverage_factor[0]
    assert content["mass"] == {
        "value": WHOLE.mass, "standard_uncertainty": pytest.approx(1e-3),
        "interval95": pytest.approx([WHOLE.mass - 1e-3 * factor, WHOLE.mass + 1e-3 * factor]), "from": "static poses",
    }  # fmt: skip
    assert content["cg"]["standard_uncertainty"] == pytest.approx([1e-4, 2e-4, 3e-4])
    assert content["provenance"]["centre"]["inputs"] == [{"file": "poses.csv", "sha256": "ab"}]
    assert len(content["provenance"]["centre"]["sha256"]) == 64
    assert not any("body." in text for text in plain.warnings)


def test_a_zero_that_each_run_has_for_itself_is_no_drift(tmp_path):
    """Sound runs beside static poses: least squares fit a zero in each run, whatever the poses say of it."""
    (tmp_path / "e.toml").write_text(T1)
    experiment, paths = Experiment.load(tmp_path / "e.toml"), []
    for seed in range(3):
        signals = Signals.of(simulate(experiment, seed=seed))
        zero = {"force": signals.force + 2.0 * seed, "moment": signals.moment + 0.1 * seed}
        paths.append(write(tmp_path / f"{seed}.mcap", dataclasses.replace(signals, **zero)))
    body = InertialParameters(experiment.mass, experiment.r_cg_from_q, experiment.inertia, np.zeros((10, 10)))
    open_to_poses = dataclasses.replace(experiment, r_cg_from_q=None, mass=None)
    assert identify_files(paths, open_to_poses, centre=centre_of(body)).consistency == ()


def test_what_lasts_from_one_series_of_poses_to_the_next_moves_the_whole_result(short):
    """A result of a shifted centre against the stated effect on all ten parameters; the tensor is linear in r."""
    run, estimator = simulate(experiment_of(short, WHOLE), "T1").run, short.estimator("smoothed")
    lasting = np.zeros((10, 1))
    lasting[:4, 0] = 2e-3, 1e-4, -3e-4, 2e-4
    plain = dataclasses.replace(centre_of(WHOLE), lasting=lasting)
    moved = dataclasses.replace(plain, mass=plain.mass + 2e-3, r_cg=plain.r_cg + lasting[1:4, 0])
    before, after = (identify(run, centre=known, estimator=estimator) for known in (plain, moved))
    effect = after.parameters.values - before.parameters.values
    (stated,) = (row.changes[:, 0] for row in before.ledger.rows if row.key)
    np.testing.assert_allclose(stated, effect, rtol=1e-3, atol=1e-3 * np.abs(effect[4:]).max())


def test_a_centre_that_contradicts_the_experiment_wins_with_a_warning(short, files):
    found = identify_files([files / "whole.mcap"], declare(short), centre=files / "whole.json")
    np.testing.assert_array_equal(found.r_cg, WHOLE.r_cg)
    assert (
        "body.r_cg_from_q is (0.00, 0.00, 53.00) mm, the static poses say (2.00, −3.00, 53.00) mm" in found.warnings[0]
    )
    assert not any("body.mass" in text for text in found.warnings)  # the same
    other = dataclasses.replace(declare(short), mass=19.8)
    assert "body.mass is 19.8 kg" in " ".join(
        identify_files([files / "whole.mcap"], other, centre=files / "whole.json").warnings
    )


@pytest.mark.usefixtures("blank_pictures")
def test_the_fixture_comes_off_by_its_runs_or_as_stated(short, files, capsys):
    out = files / "out"
    command = ["identify", files / "whole.mcap", "--experiment", files / "e.toml", "--centre", files / "whole.json"]
    tare = ["--tare", files / "empty.mcap", "--tare-centre", files / "empty.json"]
    assert main([str(word) for word in [*command, *tare, "--estimator", "smoothed", "--out", out]]) == 0
    assert "the fixture (4.2 kg) is taken off" in capsys.readouterr().out
    content = json.loads((out / "result.json").read_text())
    assert content["tare"]["method"] == "runs"
    assert content["tare"]["runs"][0]["file"] == "empty.mcap"
    assert content["tare"]["with_fixture"]["mass"]["value"] == WHOLE.mass
    assert content["mass"]["value"] == pytest.approx(WHOLE.mass - FIXTURE.mass)
    expected = (WHOLE.mass * WHOLE.r_cg - FIXTURE.mass * FIXTURE.r_cg) / (WHOLE.mass - FIXTURE.mass)
    np.testing.assert_allclose(content["cg"]["value"], expected, rtol=1e-9)
    vector = lambda r: ", ".join(f'"{x:.17g} m"' for x in r)  # noqa: E731
    moments = dict(zip(("I11", "I12", "I13", "I22", "I23", "I33"), FIXTURE.inertia, strict=True))
    tensor = ", ".join(f'{name} = "{value} kg*m^2"' for name, value in moments.items())
    (files / "stated.toml").write_text(
        f'{POSES}\n[fixture]\nmass = "4.2 kg"\nsigma_mass = "1 g"\nr_cg_from_q = [{vector(FIXTURE.r_cg)}]\n'
        f"inertia = {{ {tensor} }}\n"
    )
    other, known = Experiment.load(files / "stated.toml"), {"estimator": "smoothed", "centre": files / "whole.json"}
    stated = tare_files(identify_files([files / "whole.mcap"], other, **known), [], other).to_dict()
    assert stated["tare"]["method"] == "stated"
    u = np.array(list(content["standard_uncertainty"].values()))
    apart = np.array([stated["inertia"][name] - content["inertia"][name] for name in moments])
    assert (np.abs(apart) < 5 * u).all()
    (files / "half.toml").write_text(
        f'{POSES}\n[fixture]\nmass = "4.2 kg"\nr_cg_from_q = [{vector(FIXTURE.r_cg)}]\nsigma_mass = "2 g"\n'
    )
    half = Experiment.load(files / "half.toml")
    whole = identify_files([files / "whole.mcap"], half, estimator="smoothed", centre=files / "whole.json")
    measured = tare_files(whole, [files / "empty.mcap"], half, estimator="smoothed").to_dict()
    np.testing.assert_allclose(list(measured["inertia"].values()), list(content["inertia"].values()), rtol=1e-12)
    assert measured["tare"]["fixture"]["mass"]["standard_uncertainty"] == pytest.approx(2e-3)


def test_a_datum_and_a_scale(short, files, plain):
    turn = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    document = dict(short.document) | {
        "datum": {
            "rotation_to_body": turn.tolist(), "position": ["10 mm", "0 mm", "0 mm"],
            "sigma_rotation": ["0.1 deg", "0.1 deg", "0.1 deg"], "sigma_position": ["0.1 mm"] * 3,
        },
        "scale": {"mass": "19.7 kg", "standard_uncertainty": "5 g"},
    }  # fmt: skip
    declared = type(short).from_dict(document)
    found = identify_files([files / "whole.mcap"], declared, estimator="smoothed").to_dict()
    found["mass"].pop("conventional_bound")
    assert found["mass"] == {
        "value": 19.7, "standard_uncertainty": pytest.approx(0.005), "interval95": pytest.approx([19.6902, 19.7098]),
        "from": "declared",
    }  # fmt: skip
    assert found["about_q"]["inertia"]["I11"] > found["inertia"]["I11"]
    datum = found["about_datum"]
    np.testing.assert_allclose(
        datum["cg"]["value"], turn.T @ (np.array(found["cg"]["value"]) - [0.01, 0, 0]), rtol=1e-9
    )
    assert datum["about_cg"]["standard_uncertainty"]["I12"] > found["standard_uncertainty"]["I12"]
    assert len(found["principal"]["standard_uncertainty"]) == 3
    assert plain.to_dict()["about_datum"] is None


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--centre", "none.json"], "none.json"),
        (["--centre", "e.toml"], "e.toml is not JSON: give the centre.json"),
        (["--centre", "list.json"], "list.json is no result of `inertia centre`"),
        (["--tare", "empty.mcap"], "--tare needs the fixture's mass and centre of gravity"),
        (["--tare-centre", "empty.json"], "--tare-centre without --tare"),
        (["--tare", "none.mcap", "--tare-centre", "empty.json"], "none.mcap"),
        (["--tare", "empty.mcap", "--tare-centre", "e.toml"], "e.toml is not JSON"),
        (["--tare", "empty.mcap", "empty.mcap", "--tare-centre", "empty.json"], "a run is given twice"),
        pytest.param(
            ["--tare", "empty.mcap", "--tare-centre", "heavy.json"],
            "the fixture has 30 kg, the body with it 19.7 kg",
            marks=pytest.mark.study,
        ),
        (["--tare", "whole.mcap", "--tare-centre", "empty.json"], "is both loaded and empty"),
    ],
)
def test_options_that_cannot_be_used(files, capsys, options, words):
    saved(files / "heavy.json", dataclasses.replace(centre_of(FIXTURE), mass=30.0))
    (files / "list.json").write_text("[1]")
    named = [files / word if "." in word else word for word in options]
    out = files / "none"
    command = ["identify", files / "whole.mcap", "--experiment", files / "e.toml", *named, "--out", out]
    assert words in refused(capsys, *command)
    assert not out.exists()


@pytest.mark.parametrize(
    ("fixture", "options", "words"),
    [
        ("", [], "no fixture.inertia: state it, or name runs"),
        ('inertia = { I11 = "1 g*m^2", I22 = "1 g*m^2", I33 = "1 g*m^2" }', ["--tare", "empty.mcap"], "the fixture's inertia"),
        ("", ["--tare", "empty.mcap", "--tare-centre", "empty.json"], "the fixture's mass and centre of gravity"),
    ],
)  # fmt: skip
def test_fixtures_that_are_stated_twice_or_by_halves(files, capsys, fixture, options, words):
    text = f'{POSES}\n[fixture]\nmass = "4.2 kg"\nr_cg_from_q = ["1 mm", "2 mm", "18 mm"]\n{fixture}\n'
    (files / "f.toml").write_text(text)
    named = [files / word if "." in word else word for word in options]
    command = ["identify", files / "whole.mcap", "--experiment", files / "f.toml", "--estimator", "smoothed", *named]
    assert words in refused(capsys, *command)
