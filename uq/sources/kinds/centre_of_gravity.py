"""The believed centre of gravity: the estimator takes moments about a point beside the true one."""

from uq.sources.source import RigConstant


class CentreOfGravity(RigConstant):
    """Believed minus true centre of gravity from Q, in B [m]; no sensor sees it."""

    targets = {"r_cg": "m"}
    absence = "the centre of gravity is exact"
