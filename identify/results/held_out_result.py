"""Prediction of force and moment of runs that the estimate has not seen: errors beside what explains them.

Of each run, or half of one, the errors by axis, and a stretch of it.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from identify.display.reporting import Result, plain
from identify.display.rounding import significant

FORCE, MOMENT = ("F1", "F2", "F3"), ("M1", "M2", "M3")


@dataclass(frozen=True, eq=False)
class HeldOutRun:
    """A run, or half of one, as predicted by the others. By row: force and moment about Q, or moment about the CG."""

    file: str
    rms: Float[np.ndarray, " rows"]
    """Root mean square of measured less predicted values in the motion's band [N], [N·m]."""
    noise: Float[np.ndarray, " rows"]
    """Part of ``rms`` that the measurement noise explains [N], [N·m]."""
    of_estimate: Float[np.ndarray, " rows"]
    """Part of ``rms`` that the uncertainty of the estimate explains [N], [N·m]."""
    measured_rms: Float[np.ndarray, " rows"]
    """Root mean square of the measured values about their mean [N], [N·m]."""
    degrees_of_freedom: Float[np.ndarray, " rows"]
    """Effective degrees of freedom of the square of ``rms``."""
    noise_degrees_of_freedom: Float[np.ndarray, " rows"]
    """Degrees of freedom of the noise level, which the other runs' residuals show."""
    probability: Float[np.ndarray, " rows"]
    """Probability of an error at least as large by chance."""
    body_ratio: float
    """Ratio of the error to its expected size (rms) along directions that another body's parameters would cause."""
    body_probability: float
    """Probability of a ratio at least as large as ``body_ratio`` by chance."""
    t: Float[np.ndarray, " n"]
    """Instants of a short stretch [s]."""
    measured: Float[np.ndarray, "n rows"]
    """Measured values in the motion's band over the short stretch [N], [N·m]."""
    predicted: Float[np.ndarray, "n rows"]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the rows: force and moment, or the moment about the centre of gravity alone."""
        return (*FORCE, *MOMENT) if len(self.rms) > len(MOMENT) else MOMENT

    @property
    def expected(self) -> np.ndarray:
        """Root mean square that noise and the estimate's uncertainty explain together [N], [N·m]."""
        return np.hypot(self.noise, self.of_estimate)

    @property
    def ratio(self) -> np.ndarray:
        """Error over what is expected."""
        return self.rms / np.maximum(self.expected, 1e-300)

    @property
    def least(self) -> tuple[float, str]:
        """The least probability, and of what: a row, or "body"."""
        every = dict(zip(self.names, map(float, self.probability), strict=True)) | {"body": self.body_probability}
        name = min(every, key=lambda key: every[key])
        return every[name], name

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says of it."""
        keys = ("rms", "noise", "of_estimate", "expected", "ratio", "degrees_of_freedom", "probability")
        return {
            "file": self.file,
            **{key: dict(zip(self.names, plain(getattr(self, key)), strict=True)) for key in keys},
            "body_ratio": plain(self.body_ratio),
            "body_probability": plain(self.body_probability),
        }


LEVEL = 0.01
"""Chance that runs of one body, as declared, are called badly predicted, over all axes and runs together."""


@dataclass(frozen=True, repr=False)
class HeldOut(Result):
    """Measured less predicted force and moment of runs that the estimate has not seen, beside what explains them.

    Example: ``identify(runs, ..., validate=True).validation.to_frame()``.
    """

    runs: tuple[HeldOutRun, ...]
    """The runs, each predicted from the other runs."""
    halves: bool
    """Whether ``runs`` are the two halves of a single run."""
    level: float = LEVEL

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the rows: force and moment, or the moment about the centre of gravity alone."""
        return self.runs[0].names

    @property
    def failing(self) -> tuple[HeldOutRun, ...]:
        """Runs that are predicted worse than chance allows, by Bonferroni over all rows and runs."""
        count = len(self.runs) * (len(self.names) + 1)
        return tuple(run for run in self.runs if not run.least[0] * count >= self.level)

    @property
    def explained(self) -> bool:
        """Whether noise and the estimate's uncertainty explain all errors."""
        return not self.failing

    @property
    def text(self) -> str:
        """The verdict in one line."""
        part = "half" if self.halves else "run"
        others = f"other {part}s" if len(self.runs) > 2 else f"other {part}"
        if self.explained:
            return f"each {part} is predicted by the {others} as well as {EXPLAINED} allow ({self._largest()})"
        worst = min(self.failing, key=lambda run: run.least[0])
        more = f"; {len(self.failing) - 1} more fail" if len(self.failing) > 1 and len(self.runs) > 2 else ""
        name = worst.least[1]
        if name == "body":
            errs = f"force and moment are those of another body, by {significant(worst.body_ratio)}"
        else:
            errs = f"{name} errs by {significant(worst.ratio[worst.names.index(name)])}"
        errs = f"{errs} times what {EXPLAINED} explain"
        return f"{worst.file} is not predicted by the {others}: {errs}{more}; find what changed in between"

    def _largest(self) -> str:
        ratio, name = max((float(run.ratio.max()), run.names[int(np.argmax(run.ratio))]) for run in self.runs)
        return f"largest error {significant(ratio)} times what is expected, {name}"

    def records(self) -> list[dict[str, Any]]:
        """Return error, expected error and least probability of each row, over all runs."""
        records = []
        for k, name in enumerate(self.names):
            root = {
                key: float(np.sqrt(np.mean([getattr(run, field)[k] ** 2 for run in self.runs])))
                for key, field in RECORDED.items()
            }
            least = min(float(run.probability[k]) for run in self.runs) * len(self.runs)
            ratio = root["rms"] / max(root["expected"], 1e-300)
            inverse = [1 / run.degrees_of_freedom[k] + 1 / run.noise_degrees_of_freedom[k] for run in self.runs]
            u = ratio * float(np.sqrt(np.mean(inverse) / 2 / len(self.runs)))
            figures = {"ratio": ratio, "ratio_standard_uncertainty": u, "probability": min(least, 1.0)}
            records.append({"row": name, **root, **figures})
        return records

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says of it, in SI units."""
        return {
            "halves": self.halves,
            "explained": self.explained,
            "verdict": self.text,
            "level": self.level,
            "runs": [run.to_dict() for run in self.runs],
        }


RECORDED = {"measured": "measured_rms", "rms": "rms", "noise": "noise", "of_estimate": "of_estimate",
            "expected": "expected"}  # fmt: skip
EXPLAINED = "noise and the estimate's uncertainty"
