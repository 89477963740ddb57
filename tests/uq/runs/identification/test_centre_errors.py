"""Errors of the load cell in static poses, declared or not, and of the same cell in the runs identified with them.

Poses are made here in plain NumPy, runs by tests/helpers/laboratory.py.
"""

import json
from dataclasses import replace
from functools import cache

import msgspec
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.estimation.static_poses.centre_result import Centre
from identify.exceptions import RunError
from tests.helpers.laboratory import FULL_SCALE, Setup, cell_reading, measure
from tests.helpers.laboratory_files import document, source, write
from tests.helpers.laboratory_mechanics import GRAVITY, MASS, R_CG
from uq.experiment.experiment import Experiment
from uq.experiment.undeclared_table import NONE
from uq.runs.identification.centre_errors import check_declared
from uq.runs.identification.centre_prior import load_centre
from uq.runs.identification.identify_files import identify_files
from uq.runs.identification.static_centre import centre_file

pytestmark = pytest.mark.usefixtures("few_draws", "unjudged")
SHORT = {"seconds": 15.0}
GAIN = 2.5e-3
"""Standard uncertainty of each channel's gain: ±0.5 %, k = 2."""
DECLARED = [source("f", "F", "scale", [100 * GAIN] * 3), source("m", "M", "scale", [100 * GAIN] * 3)]
MORE = [
    source("a", "wrench", "misalignment", [1e-3] * 3),
    source("c", "wrench", "cross_talk", 2e-3),
    {"name": "g", "target": "gravity", "kind": "bias", "group": "rig", "sigma": "0.005 m/s^2"},
]


def poses_file(path, *, matrix=None, noise=0.0, seed=0):
    """A table of 16 poses that turn all ways, read by a load cell that multiplies the wrench by a matrix."""
    rng = np.random.default_rng([7, seed])
    up = GRAVITY * Rotation.random(16, rng=np.random.default_rng(5)).as_matrix()[:, 2]
    wrench = np.hstack([MASS * up, np.cross(R_CG, MASS * up)]) @ (np.eye(6) if matrix is None else matrix).T
    wrench = wrench + noise * rng.standard_normal(wrench.shape) * [0.05, 0.05, 0.05, 0.003, 0.003, 0.003]
    rows = [",".join(f"{value!r}" for value in row) for row in np.hstack([wrench, -up]).tolist()]
    path.write_text("\n".join(["fx,fy,fz,tx,ty,tz,gx,gy,gz", *rows]) + "\n")
    return path


def experiment_of(measured, method="source", sources=DECLARED):
    content = document(measured, method, sources)
    del content["body"]
    content["poses"] = {"force": ["fx", "fy", "fz"], "moment": ["tx", "ty", "tz"], "gravity": ["gx", "gy", "gz"]}
    return Experiment.from_dict(content)


@pytest.fixture(scope="module")
def clean():
    return measure(1, **SHORT)


def turned(vector):
    return np.kron(np.eye(2), Rotation.from_rotvec(vector).inv().as_matrix())


TALK = np.zeros((6, 6))
TALK[4, 0] = 2e-3 * FULL_SCALE[4] / FULL_SCALE[0]


@pytest.mark.parametrize(
    ("name", "matrix"),
    [
        ("f 2", np.eye(6) + GAIN * np.diag([0, 1, 0, 0, 0, 0])),
        ("m 3", np.eye(6) + GAIN * np.diag([0, 0, 0, 0, 0, 1])),
        ("a 1", turned([1e-3, 0, 0])),
        ("c 25", np.eye(6) + TALK),
        ("g 1", (1 + 0.005 / GRAVITY) * np.eye(6)),
    ],
)
def test_an_error_does_to_the_centre_what_it_does_to_the_poses(tmp_path, clean, name, matrix):
    """One standard uncertainty of one axis, put into the wrench of the poses: gravity acts on force and moment alike."""
    experiment = experiment_of(clean, sources=[*DECLARED, *MORE])
    plain = centre_file(poses_file(tmp_path / "poses.csv"), experiment)
    moved = centre_file(poses_file(tmp_path / "moved.csv", matrix=matrix), experiment)
    stated = plain.lasting_errors[name]
    np.testing.assert_allclose(stated, moved.values - plain.values, rtol=0.01, atol=2e-3 * np.abs(stated).max())
    assert np.abs(stated).max() > 0


def test_a_declared_gain_reaches_mass_and_centre(tmp_path, clean):
    """Gains of the axes are independent: the mass, of directions drawn evenly, has a third of each one's variance."""
    path = poses_file(tmp_path / "poses.csv", noise=1.0)
    with_gain, without = (centre_file(path, experiment_of(clean, sources=s)) for s in (DECLARED, []))
    assert with_gain.standard_uncertainty[0] == pytest.approx(MASS * GAIN / np.sqrt(3), rel=0.2)
    assert without.standard_uncertainty[0] < 0.2 * with_gain.standard_uncertainty[0]
    assert with_gain.standard_uncertainty[3] > R_CG[2] * GAIN / 3
    written = with_gain.to_dict()
    assert written["lasting_names"] == [f"{name} {k}" for name in "fm" for k in (1, 2, 3)]
    again = type(with_gain).from_dict(json.loads(json.dumps(written)))
    np.testing.assert_allclose(again.lasting_errors["f 1"], with_gain.lasting_errors["f 1"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("laboratories")


def saved(path, centre):
    path.write_text(json.dumps(centre.to_dict()))
    return path


@cache
def identified(tmp_path, seed, method, *, shared=True):
    """A laboratory whose load cell has gains of the declared size, in poses and run, and zeros that are those of the poses."""
    rng = np.random.default_rng([18, seed])
    gain = GAIN * rng.standard_normal(6)
    measured = measure(seed, cell_gain=tuple(gain), drawn=0.0, **SHORT)
    experiment = experiment_of(measured, method)
    centre = centre_file(poses_file(tmp_path / "p.csv", matrix=np.diag(1 + gain), noise=1.0, seed=seed), experiment)
    path = write(tmp_path / f"run{seed}.mcap", measured)
    if not shared:
        centre = replace(centre, lasting=1e-9 * centre.lasting)
    saved(tmp_path / "c.json", centre)
    return measured, identify_files([path], experiment, centre=tmp_path / "c.json")


@pytest.mark.parametrize(("method", "runs"), [pytest.param("source", 2, marks=pytest.mark.slow), pytest.param("joint", 2, marks=pytest.mark.slow), pytest.param("gls", 2, marks=pytest.mark.study),
                         *(pytest.param(m, 20, marks=pytest.mark.study) for m in ("source", "gls", "joint"))])  # fmt: skip
def test_errors_of_all_ten_are_as_large_as_the_uncertainty_says(folder, method, runs):
    """Root mean square of errors over u of mass, centre and tensor together; 20 runs each in the study."""
    ratio = []
    for seed in range(runs):
        measured, result = identified(folder, seed, method)
        ten = result.parameters
        truth = np.concatenate([[MASS], R_CG, measured.truth])
        ratio.append((ten.values - truth) / ten.standard_uncertainty)
        assert np.linalg.eigvalsh(ten.covariance / np.outer(*[ten.standard_uncertainty] * 2)).min() > -1e-9
    rms = np.sqrt(np.mean(np.square(ratio), axis=0))
    print(method, np.round(rms, 2), np.sqrt(np.mean(rms**2)))
    assert 0.4 < np.sqrt(np.mean(rms**2)) < 1.6


def test_a_gain_of_both_is_not_counted_twice(folder):
    """What the moment's gain has done to r_CG cancels with what it does to the run: independent, the two would add."""
    (_, linked), (_, apart) = (identified(folder, 0, "source"), identified(folder, 0, "source", shared=False))
    assert linked.standard_uncertainty[3] < 0.7 * apart.standard_uncertainty[3]
    assert {"f", "m"} <= {row.key for row in linked.ledger.rows}


AXES = [source("a", "wrench", "misalignment", [1e-3] * 3)]
GRAVITY_ERROR = [{"name": "g", "target": "gravity", "kind": "bias", "group": "rig", "sigma": "0.005 m/s^2"}]
CORRELATED = [{**DECLARED[0], "correlation": [[1, 0.9, 0], [0.9, 1, 0], [0, 0, 1]]}, DECLARED[1]]


@pytest.mark.parametrize(
    ("before", "after", "made"),
    [
        ([], DECLARED, "without f, m"),
        (DECLARED, DECLARED + AXES, "without a"),
        (DECLARED, DECLARED + GRAVITY_ERROR, "without g"),
        (DECLARED, [source("f", "F", "scale", [0.5] * 3), DECLARED[1]], "with other figures of f"),
        (DECLARED, CORRELATED, "with other figures of f"),
        (DECLARED, [{**DECLARED[0], "distribution": "student_t", "degrees_of_freedom": 4, "scale": "0.25 %", "sigma": None},
                    DECLARED[1]], "with other figures of f"),
        (DECLARED + AXES, DECLARED[:1], "with m, which is no longer declared, a, which is no longer declared"),
    ],
)  # fmt: skip
def test_a_centre_of_other_declared_errors_is_refused(folder, clean, before, after, made):
    """Nothing tells what an error that is declared later does to the poses; the cure is a new centre."""
    after = [{key: value for key, value in table.items() if value is not None} for table in after]
    stale, new = (
        saved(folder / f"{name}.json", centre_file(poses_file(folder / "s.csv", noise=1.0), experiment_of(clean, sources=s)))
        for name, s in (("stale", before), ("new", after))
    )  # fmt: skip
    experiment = experiment_of(clean, sources=after)
    with pytest.raises(RunError, match=f"^stale.json was made {made}: run `inertia centre` again with what"):
        identify_files(["run.mcap"], experiment, centre=stale)
    check_declared(experiment, load_centre(new), "new.json")


def test_a_centre_of_other_attitudes_is_refused_and_what_does_not_act_on_it_is_not_asked(folder, clean):
    """Biases, words and the experiment's table of poses left out change nothing in the centre."""
    path, declared = write(folder / "attitudes.mcap", clean), experiment_of(clean)
    centre = saved(folder / "attitudes.json", centre_file(poses_file(folder / "s.csv", noise=1.0), declared))
    turned = replace(declared, poses=msgspec.structs.replace(declared.poses, sigma_alignment=0.01))
    with pytest.raises(RunError, match=r"with other figures of poses\.sigma_alignment"):
        identify_files([path], turned, centre=centre)
    words = [{**table, "reference": "a certificate", "group": "another"} for table in DECLARED]
    others = experiment_of(clean, sources=[*words, source("F_zero", "F", "bias", [9.0] * 3)])
    plain, other = (identify_files([path], e, centre=centre) for e in (replace(declared, poses=None), others))
    np.testing.assert_allclose(plain.parameters.covariance[:4, :4], other.parameters.covariance[:4, :4])


@pytest.mark.parametrize("provenance", [{}, {"resolved": 3}, {"resolved": {"sources": [3], "mixing": "a"}}])
def test_a_centre_whose_provenance_does_not_tell_its_errors_is_refused(tmp_path, clean, provenance):
    experiment = experiment_of(clean)
    centre = replace(centre_file(poses_file(tmp_path / "s.csv", noise=1.0), experiment), provenance=provenance)
    with pytest.raises(RunError, match="with other figures of f, m"):
        check_declared(experiment, centre, "centre.json")


# Undeclared errors

UNIT = np.eye(6)


@pytest.fixture(scope="module")
def silent():
    return measure(1, seconds=15.0, noise=0.0, drawn=0.0)


def by_name(result):
    return {effect.error: effect.changes for effect in result.undeclared.rows}


@pytest.mark.parametrize(
    ("name", "column", "matrix"),
    [
        ("force_gain", 0, np.diag([1.0005] * 3 + [1] * 3)),
        ("moment_gain_by_axis", 2, UNIT + 0.0005 * np.diag(UNIT[5])),
        ("load_cell_axes", 1, turned([0, 0.001, 0])),
        ("gravity", 0, (1 + 0.003 / GRAVITY) * UNIT),
    ],
)
def test_the_centre_is_off_as_the_poses_are(tmp_path, silent, name, column, matrix):
    """By a fifth of the typical size, so that what is left of second order is small."""
    experiment = experiment_of(silent, sources=[])
    plain = centre_file(poses_file(tmp_path / "p.csv"), experiment)
    off = centre_file(poses_file(tmp_path / "m.csv", matrix=matrix), experiment).values - plain.values
    expected = by_name(plain)[name][:, column] / 5
    for rows, atol in ((slice(0, 1), 1e-5), (slice(1, 4), 1e-7)):
        np.testing.assert_allclose(off[rows], expected[rows], atol=0.02 * np.abs(expected[rows]).max() + atol)


def test_the_conventional_bound_is_written_shown_and_read_back(tmp_path, silent):
    """The mass: gains of 0.25 % in common and by axis, of which a third counts, and 15 mm/s² of 9.81 m/s²."""
    result = centre_file(poses_file(tmp_path / "p.csv", noise=1.0), experiment_of(silent, sources=[]))
    half, wide = (np.ptp(ends, axis=1) / 2 for ends in (result.interval95, result.conventional_bound))
    added = MASS * np.sqrt(0.0025**2 * 4 / 3 + (0.015 / GRAVITY) ** 2)
    talk = np.linalg.norm(by_name(result)["cross_talk"], axis=1)[0]
    assert wide[0] == pytest.approx(np.hypot(half[0], 2 * np.hypot(added, talk)), rel=0.03)
    u = np.sqrt(np.sum([np.square(changes).sum(axis=1) for changes in by_name(result).values()], axis=0))
    np.testing.assert_allclose(wide, np.hypot(half, 2 * u), rtol=1e-6)
    content = json.loads(json.dumps(result.to_dict()))
    assert content["mass"]["conventional_bound"] == result.conventional_bound[0].tolist()
    np.testing.assert_array_equal(Centre.from_dict(content).conventional_bound, result.conventional_bound)
    assert Centre.from_dict(content | {"undeclared": None}).conventional_bound is None
    assert "conventional bound" in repr(result)
    complete = replace(experiment_of(silent, sources=[]), undeclared=NONE)
    assert "conventional bound" not in repr(centre_file(tmp_path / "p.csv", complete))


def test_a_declared_alignment_takes_the_place_of_the_load_cells_axes(tmp_path, silent):
    experiment = experiment_of(silent, sources=[])
    aligned = replace(experiment, poses=msgspec.structs.replace(experiment.poses, sigma_alignment=1e-3))
    path = poses_file(tmp_path / "p.csv")
    assert set(by_name(centre_file(path, experiment))) - set(by_name(centre_file(path, aligned))) == {"load_cell_axes"}


def ten(result):
    return np.concatenate([[result.mass], result.r_cg, result.inertia])


@pytest.mark.slow
def test_poses_and_runs_of_one_load_cell_err_together(tmp_path, silent):
    """A gain of the force makes mass and centre wrong, and by least squares not the tensor: the two effects cancel."""
    experiment, gains = experiment_of(silent, sources=[]), np.array([0.0025] * 3 + [-0.0025] * 3)

    def answer(spoilt, matrix):
        centre = centre_file(poses_file(tmp_path / "p.csv", matrix=matrix), experiment)
        centre = replace(centre, covariance=centre.covariance + np.diag([1e-6, *[1e-8] * 3, *[1e-4] * 3, *[1e-6] * 3]))
        path = write(tmp_path / f"{spoilt is silent}.mcap", spoilt)
        return identify_files([path], experiment, centre=saved(tmp_path / "c.json", centre))

    wrench = cell_reading(Setup(cell_gain=tuple(gains)), np.hstack([silent.force, silent.moment]), silent.t_wrench)
    spoilt = replace(silent, force=wrench[:, :3], moment=wrench[:, 3:])
    plain = answer(silent, UNIT)
    off = ten(answer(spoilt, np.diag(1 + gains))) - ten(plain)
    by_force, by_moment = (by_name(plain)[name][:, 0] for name in ("force_gain", "moment_gain"))
    assert np.abs(by_force[4:]).max() < 0.01 * np.abs(by_moment[4:]).max()
    for rows in (slice(0, 1), slice(1, 4), slice(4, 10)):
        expected = (by_force - by_moment)[rows]
        np.testing.assert_allclose(off[rows], expected, atol=0.02 * np.abs(expected).max() + 1e-6)
    assert plain.with_undeclared.standard_uncertainty[0] > 0.0025 * MASS
