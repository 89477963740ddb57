"""Derivatives of a pooled joint estimate by errors that count as zero: against all runs' equations at once."""

import numpy as np

from identify.joint.joint_model import COUNT, SLICES, TEN
from identify.joint.priors import Prior, indices
from identify.judge.held_errors import pooled_change
from identify.judge.run_fit import RunFit

PLACES = {"r_cg": slice(0, 3), "inertia": slice(3, 9), "moment_offset": slice(9, 12)}
SIGMA = np.array([0.1, 0.2, 0.3])


def fit_of(columns):
    """A run's fit with nothing but its columns and its prior, which knows r_CG alone."""
    root = np.zeros((COUNT, 12))
    for name, where in PLACES.items():
        root[SLICES[name], where] = np.diag(SIGMA) if name == "r_cg" else np.eye(where.stop - where.start)
    fit = object.__new__(RunFit)
    prior = Prior(np.zeros(COUNT), root, np.array([1.0] * 3 + [0.0] * 9))
    for name, value in (("columns", columns), ("prior", prior)):
        object.__setattr__(fit, name, value)
    return fit


def test_runs_share_the_body_and_its_prior_and_have_their_own_offsets():
    """Least squares on the rows of both runs and one prior of r_CG, an offset for each run: the same to rounding."""
    rng = np.random.default_rng(5)
    columns, added = (rng.standard_normal((2, 40, 6, count)) for count in (12, 4))
    shift = pooled_change([fit_of(of_run) for of_run in columns], list(added), {"r_cg", "inertia"})[indices(TEN)]
    rows, sides = columns.reshape(2, 240, 12), added.reshape(2, 240, 4)
    apart = [np.hstack([run[:, :9], *(run[:, 9:] * (k == own) for own in (0, 1))]) for k, run in enumerate(rows)]
    prior = np.eye(3, 15)
    together = np.linalg.lstsq(np.vstack([*apart, prior]), np.vstack([*sides, np.zeros((3, 4))]))[0]
    expected = np.vstack([np.zeros((1, 4)), SIGMA[:, None] * together[:3], together[3:9]])
    np.testing.assert_allclose(shift, expected, atol=1e-12)
