"""The believed centre of gravity: the estimator takes moments about a point beside the true one."""

from uq.sources.source import ErrorKind


class CentreOfGravity(ErrorKind):
    """Believed minus true centre of gravity from Q, in B [m]; no sensor sees it."""

    name = "bias"
    targets = {"r_cg": "m"}
    absence = "the centre of gravity is exact"
    constant = True
    perturbs = {"r_cg": "r_cg"}
