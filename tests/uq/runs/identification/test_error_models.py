"""Every error that is coded by hand, for speed or on sums, against the act of its file.

A run is simulated with errors that act one after another, in the order of their stages, and given to the estimator's prediction: what a further step
of an error changes of measured less predicted is what its columns say.
"""

from dataclasses import replace

import numpy as np
import pytest

from identify.errors.error_model import CELL_MATRIX, UNIT_WRENCHES, composed
from identify.errors.registry import ERRORS
from identify.errors.rig_state import RigState
from identify.estimation.joint.error_columns import ErrorColumns
from identify.estimation.joint.joint_model import BY_ACT, COUNT, SIZES, SLICES, Model
from identify.estimation.joint.predicted_wrench import PredictedWrench
from identify.least_squares.declared_effects import EFFECTS, DeclaredError, residual_changes
from identify.least_squares.run_lines import run_lines
from identify.signals.band_limited_run import InBand
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.resample import uniform_spline
from identify.signals.run import Run
from uq.monte_carlo.gram_sums.error_maps import cell_map, gyro_map
from uq.runs.identification.centre_errors import ON_POSES, wrench_error
from uq.sources.constant_errors import no_errors

WAYS = ("still", "accelerometer", "none")
STEP, STRIDE, FIRST, ROWS = 0.01, 2, 10, 120
NODES = STEP * np.arange(STRIDE * ROWS + 2 * FIRST)
ARM = np.array([0.02, 0.03, -0.04])
GRAVITY = 9.8
BODY = {
    "inertia": [0.38, 0.004, -0.006, 0.02, 0.002, 0.384], "mass": [19.7], "r_cg": [0.004, -0.003, 0.053],
    "cg_from_still": [0.01, -0.02, 0.11],
}  # fmt: skip
KNOWN = {
    "imu_axes": [3e-2, -0.2, 5e-2], "gyro_scale": [0.1, -0.2, 0.1], "gyro_bias": [4e-3, -3e-3, 2e-3],
    "gyro_drift": [1e-3, 2e-3, -1e-3], "delay": [13e-3], "accelerometer_bias": [0.1, -0.2, 0.05],
    "zero": [1.0, 2.0, 3.0, 0.1, 0.2, 0.3], "drift": [0.5, 0.0, -0.5, 0.0, 0.1, 0.0], "gravity": [0.02],
    "cross_talk": 1e-4 * np.arange(36.0),
}  # fmt: skip
KNOWN = {name: np.asarray(values) for name, values in KNOWN.items()}
"""Errors that the estimator knows, far from zero."""


def smooth(t, seed):
    """Three signals of a few frequencies."""
    rng = np.random.default_rng(seed)
    frequency, phase, size = rng.uniform(0.3, 2.0, (4, 3)), rng.uniform(0, 6, (4, 3)), rng.uniform(0.1, 0.4, (4, 3))
    return (size * np.sin(2 * np.pi * frequency * t[:, None, None] + phase)).sum(axis=1)


def model_of(way, motion, wrench, up):
    rows = InBand(
        t=NODES[FIRST : FIRST + STRIDE * ROWS : STRIDE], force=wrench[:, :3].T, moment=wrench[:, 3:].T,
        used=np.ones(ROWS, bool), motion=uniform_spline(motion, STEP, degree=5).pieces, step=STEP, stride=STRIDE,
        first=FIRST, factor=STRIDE, band=2.5,
    )  # fmt: skip
    return Model(rows=rows, up=up, gravity=GRAVITY, imu_position=ARM, specific_force=way, used=rows.used)


def clean(way):
    """A run without errors, and its motion at the nodes."""
    up, motion = np.array([0.1, -0.2, 0.97]), np.hstack([smooth(NODES, 1), [0, 0, 9.8] + 3 * smooth(NODES, 2)])
    theta = np.zeros(COUNT)
    for name, values in BODY.items():
        theta[SLICES[name]] = values
    wrench = np.hstack([BODY["mass"] * motion[:, 3:], smooth(NODES, 4)])[FIRST:][: STRIDE * ROWS : STRIDE]
    run = PredictedWrench(model_of(way, motion, wrench, up / np.linalg.norm(up)), theta)
    return run, motion


def believed(beliefs, known, cell):
    """The unknowns of an estimator that knows some errors, and has beliefs."""
    theta = np.zeros(COUNT)
    for name in BODY:
        theta[SLICES[name]] = getattr(beliefs, name)[0]
    theta[SLICES["gravity"]] = beliefs.gravity[0] - GRAVITY
    for name, values in known.items():
        if name not in ("gravity", "cross_talk"):
            where = np.concatenate([np.arange(COUNT)[SLICES[unknown]] for unknown in ERRORS[name].unknowns])
            theta[where] = values
    theta[SLICES["cell_matrix"]] = cell
    return theta


def residuals(way, known, error, numbers):
    """Measured less predicted of a run with known errors, one of which, or a further one, errs by some numbers."""
    run, motion = clean(way)
    columns = ErrorColumns(run)
    nodes, rows = replace(columns.nodes, accelerometer=motion[:, 3:]), columns.rows
    if way == "still":
        nodes = replace(nodes, accelerometer=columns.nodes.accelerometer)
    elif way == "none":  # what the force tells
        rows = replace(rows, wrench=np.hstack([run.signals.force, run.wrench[:, 3:]]))
    errors = [*ERRORS.values(), *[error] * (error.name not in ERRORS)]
    acting = {name: values for name, values in known.items() if name != "gravity"}
    acting[error.name] = acting.get(error.name, 0.0) + numbers
    nodes, rows = (composed(errors, state, acting) for state in (nodes, rows))
    gravity = known.get("gravity", np.zeros(1))
    cell = composed([ERRORS["cross_talk"]], UNIT_WRENCHES, known).wrench.T - np.eye(6)
    return predicted(way, nodes, rows, known, cell.ravel(), gravity)


def predicted(way, nodes: RigState, rows: RigState, known, cell, gravity):
    model = model_of(way, np.hstack([nodes.gyro, nodes.accelerometer]), rows.wrench, nodes.vertical)
    beliefs, parts = rows.beliefs, []
    total = np.hstack(list(vars(beliefs).values()))
    steps = np.flatnonzero(np.any(np.diff(total, axis=0) != 0, axis=1)) + 1
    for some in np.split(np.arange(ROWS), steps):
        at = replace(beliefs, **{name: values[some] for name, values in vars(beliefs).items()})
        at = replace(at, gravity=at.gravity + gravity)
        run = PredictedWrench(replace(model, imu_position=at.imu_position[0]), believed(at, known, cell))
        parts.append(run.counted(run.residuals[:, :, None])[some, :, 0])
    return run, np.concatenate(parts)


def by_act(way, known, error, step=1e-4):
    """Central differences of the residuals by each number, and the prediction without the error."""
    run, _ = residuals(way, known, error, np.zeros(error.count))
    ends = [[residuals(way, known, error, sign * unit)[1] for sign in (1, -1)] for unit in step * np.eye(error.count)]
    return run, np.stack([(plus - minus) / (2 * step) for plus, minus in ends], axis=2)


def assert_close(run, columns, expected, within):
    assert np.abs(run.counted(columns) - expected).max() / max(np.abs(expected).max(), 1e-3) <= within


TENSOR = replace(ERRORS["moving_part"], name="tensor", act=lambda state, packed: state.with_less("inertia", packed))


SMALL = {"mounting_frequency": 1e-5, "nonlinearity": 1e-6}


def columns():
    """Each error with an accelerometer; those of which derivatives are coded by hand beside a still body, too."""
    for error in ERRORS.values():
        for way in WAYS:
            fast = way == "accelerometer" or (way == "still" and error.by_hand)
            if error.name != "moving_part":
                yield pytest.param(error, way, id=f"{error.name}-{way}", marks=[] if fast else [pytest.mark.slow])


@pytest.mark.parametrize(("error", "way"), [*columns()])
def test_columns_are_what_the_error_does(error, way):
    """Beside a few splines and the quadrature of the attitude, which the columns have on rows or nodes alone."""
    run, expected = by_act(way, {}, error, SMALL.get(error.name, 1e-4))
    columns = ErrorColumns(run)
    by_hand = error.by_hand or error.unknowns == CELL_MATRIX
    assert_close(run, columns.columns(error) if by_hand else columns.by_act(error), expected, 2e-4)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    "error", [TENSOR, *(error for error in ERRORS.values() if error.by_hand)], ids=lambda e: e.name
)
def test_derivatives_of_the_joint_model_are_what_the_errors_do(error, way):
    """Far from no error. In the attitude, the joint model's slow errors are not late: a product of two errors."""
    apart = {"delay"} if error.name != "delay" else {"delay", "gyro_drift"}
    known = {name: value for name, value in KNOWN.items() if not (way == "still" and name in apart)}
    if way == "none":  # whose columns leave out what the matrix does to the measured force
        known.pop("cross_talk")
    run, expected = by_act(way, known, error)
    names = ("inertia",) if error is TENSOR else error.unknowns
    columns = np.concatenate([run.derivative(name) for name in names], axis=2)
    assert_close(run, columns, expected, 1e-5)


@pytest.mark.parametrize("error", [error for error in ERRORS.values() if error.linear], ids=lambda e: e.name)
def test_a_linear_error_is_in_proportion_to_its_numbers(error):
    state = ErrorColumns(clean("accelerometer")[0]).rows
    numbers = np.random.default_rng(5).standard_normal(error.count)
    derivatives, after = error.derivatives(state), error.act(state, numbers).parts
    for name, part in state.parts.items():
        expected = part + (derivatives[name] @ numbers if name in derivatives else 0.0)
        np.testing.assert_allclose(after[name], expected, rtol=0, atol=1e-10 * np.abs(after[name]).max() + 1e-15)


def test_every_unknown_of_the_joint_model_is_held():
    """But for the wander, a random walk of the attitude that is none of alpha, and for errors that are so by their act."""
    held = {
        name for error in ERRORS.values() for name in error.unknowns if error.by_hand or error.unknowns == CELL_MATRIX
    }
    assert held | {"inertia", "wander"} == set(SIZES) - set(BY_ACT)


def drawn(seed):
    """Errors of load cell and gyro as large as angles of a radian and parts of one."""
    rng = np.random.default_rng(seed)
    return {name: rng.standard_normal(ERRORS[name].count) for name in (*ON_CELL, *ON_GYRO)}


ON_CELL = {"load_cell_axes": "cell_misalignment", "cross_talk": "cell_cross_talk", "gain": "cell_scale"}
ON_GYRO = {"gyro_axes": "gyro_misalignment", "gyro_scale": "gyro_scale"}
"""Fields of the errors that trials on sums draw."""


@pytest.mark.parametrize("names", [*ON_CELL, ("load_cell_axes", "gain"), ("cross_talk", "gain"), (*ON_CELL,)], ids=str)
def test_the_load_cells_map_is_what_its_errors_do_together(names):
    names = (names,) if isinstance(names, str) else names
    numbers, errors = {name: drawn(1)[name] for name in names}, no_errors()
    for name, values in numbers.items():
        field = ON_CELL[name]
        errors = errors._replace(**{field: values.reshape(getattr(errors, field).shape)})
    read = composed(ERRORS.values(), UNIT_WRENCHES, numbers).wrench.T
    np.testing.assert_allclose(cell_map(errors), read, rtol=0, atol=1e-12)


@pytest.mark.parametrize("names", [*ON_GYRO, (*ON_GYRO,)], ids=str)
def test_the_gyros_map_is_what_its_errors_do_together(names):
    names = (names,) if isinstance(names, str) else names
    numbers = {name: drawn(2)[name] for name in names}
    state = replace(UNIT_WRENCHES, gyro=np.vstack([np.eye(3)] * 2), gyro_slope=np.vstack([np.eye(3)] * 2))
    read = composed(ERRORS.values(), state, numbers)
    expected = gyro_map(no_errors()._replace(**{ON_GYRO[name]: values for name, values in numbers.items()}))
    for signal in (read.gyro, read.gyro_slope):
        np.testing.assert_allclose(expected, signal[:3].T, rtol=0, atol=1e-12)


ON_WEIGHT = [error for error in ERRORS.values() if set(error.unknowns) & set(ON_POSES)]


@pytest.mark.parametrize("error", ON_WEIGHT, ids=lambda error: error.name)
def test_static_poses_have_what_the_errors_do_to_a_weight(error):
    weight = np.random.default_rng(3).standard_normal((6, 6))
    beliefs = replace(UNIT_WRENCHES.beliefs, gravity=np.full((6, 1), GRAVITY))
    slopes = error.derivatives(replace(UNIT_WRENCHES, wrench=weight, beliefs=beliefs))
    for number in range(error.count):
        if error.name == "gravity":
            unit, expected = np.ones(1), -weight * slopes["gravity"][:, :, number] / GRAVITY
        else:
            expected, unit = slopes["wrench"][:, :, number], error.by_cell_matrix[:, number]
        np.testing.assert_allclose(wrench_error(error.unknowns[0], unit, weight, GRAVITY), expected, atol=1e-9)


ON_LINES = {
    "cell_matrix": ("gain", "cross_talk", "load_cell_axes"), "gyro_scale": ("gyro_scale",), "rotation": ("gyro_axes",),
    "delay": ("delay",),
}  # fmt: skip
"""Errors of each unknown of which weighted least squares know the effect on lines."""


@pytest.mark.parametrize("name", [name for names in ON_LINES.values() for name in names])
def test_lines_of_weighted_least_squares_have_what_the_errors_do(name):
    """The delay's slope is that of second differences, and none at the ends: within 2 % of the largest."""
    t, error, step = 0.01 * np.arange(600), ERRORS[name], 1e-4
    wrench, omega = np.hstack([smooth(t, 5), smooth(t, 6)]), smooth(t, 7)
    spec = EstimatorSpec("central", "central", 2.5)
    blank = np.zeros((600, 3))
    signals = dict.fromkeys(("omega", "alpha", "specific_force", "up", "turning"), blank)
    true = replace(UNIT_WRENCHES.true, t=t, duration=6.0, **signals)
    state = replace(UNIT_WRENCHES, true=true, wrench=wrench, gyro=omega, gyro_slope=blank, accelerometer=blank)

    def lines(numbers):
        read = error.act(state, numbers)
        return run_lines(Run.from_arrays(t, read.wrench[:, :3], read.wrench[:, 3:], read.gyro), spec)

    record, inertia, r_cg = lines(np.zeros(error.count)), np.array(BODY["inertia"]), np.array(BODY["r_cg"])
    for unit in np.eye(error.count)[:: max(error.count // 6, 1)]:
        ends = [lines(sign * step * unit).residuals(inertia, r_cg) for sign in (1, -1)]
        expected = (ends[0] - ends[1]) / (2 * step)
        numbers = error.by_cell_matrix @ unit if error.unknowns == CELL_MATRIX else unit
        (unknown,) = error.unknowns
        changes = residual_changes(record, inertia, r_cg, [[DeclaredError(unknown, numbers)]])[:, :, 0]
        within = 0.02 if name == "delay" else 1e-6
        np.testing.assert_allclose(changes, expected, rtol=0, atol=within * np.abs(expected).max())


def test_every_effect_on_lines_is_held():
    assert set(ON_LINES) == set(EFFECTS)
