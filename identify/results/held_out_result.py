"""Prediction of force and moment of runs that the estimate has not seen: errors beside what explains them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.reporting import Result
from identify.results.held_out_run import HeldOutRun
from identify.rounding import significant

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
