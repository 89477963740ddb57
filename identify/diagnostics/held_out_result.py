"""Prediction of force and moment of runs that the estimate has not seen: errors beside what explains them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.diagnostics.held_out_run import FORCE, MOMENT, HeldOutRun
from identify.reporting import Drawing, Result
from identify.rounding import fixed, significant, with_uncertainty
from identify.text_tables import Table

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
        each = "half" if self.halves else "run"
        others = f"other {each}s" if len(self.runs) > 2 else f"other {each}"
        if self.explained:
            return f"each {each} is predicted by the {others} as well as {EXPLAINED} allow ({self._largest()})"
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

    def tables(self) -> list[Table]:
        """Return errors by axis over all runs, and by run."""
        return [self._by_axis(), self._by_run()]

    def _by_axis(self) -> Table:
        rows = []
        for record in self.records():
            figures = (record[key] for key in ("measured", "rms", "noise", "of_estimate", "expected"))
            unit = "N" if record["row"] in FORCE else "N·m"
            ratio = with_uncertainty(record["ratio"], record["ratio_standard_uncertainty"])
            rows.append([f"{record['row']}, {unit}", *map(significant, figures), ratio, _chance(record["probability"])])
        head = ["rms", "measured", "error", "by noise", "by the estimate", "expected", RATIO, "probability"]
        which = f"each {'half' if self.halves else 'run'} by the other{'s' if len(self.runs) > 2 else ''}"
        return Table(f"Force and moment predicted, {which}", head, rows, self._note())

    def _note(self) -> str:
        about = "" if len(self.names) > len(MOMENT) else ABOUT_CG
        verdict = self.text[0].upper() + self.text[1:]
        return f"{about}{verdict}. {NOTE}"

    def _by_run(self) -> Table:
        rows = [
            [run.file, *(fixed(ratio, 2) for ratio in run.ratio), fixed(run.body_ratio, 2), _chance(run.least[0])]
            for run in self.runs
        ]
        head = ["", *self.names, "as another body", "least probability"]
        return Table("Error over what is expected", head, rows, BODY)

    def title(self) -> str:
        """Return what was done."""
        return "Held-out prediction"

    def notes(self) -> list[str]:
        """Return the verdict."""
        return [self.text]

    def records(self) -> list[dict[str, Any]]:
        """Return error, expected error and least probability of each row, over all runs."""
        records = []
        for k, name in enumerate(self.names):
            root = {
                key: float(np.sqrt(np.mean([getattr(run, of)[k] ** 2 for run in self.runs])))
                for key, of in RECORDED.items()
            }
            least = min(float(run.probability[k]) for run in self.runs) * len(self.runs)
            ratio = root["rms"] / max(root["expected"], 1e-300)
            inverse = [1 / run.degrees_of_freedom[k] + 1 / run.noise_degrees_of_freedom[k] for run in self.runs]
            u = ratio * float(np.sqrt(np.mean(inverse) / 2 / len(self.runs)))
            figures = {"ratio": ratio, "ratio_standard_uncertainty": u, "probability": min(least, 1.0)}
            records.append({"row": name, **root, **figures})
        return records

    def drawings(self) -> list[Drawing]:
        """Return measured and predicted, of the run that is predicted worst."""
        worst = min(self.runs, key=lambda run: run.least[0])

        def draw():
            from identify.diagnostics.held_out_figure import prediction

            return prediction(worst, [max(run.ratio[k] for run in self.runs) for k in range(len(self.names))])

        return [Drawing("validation", f"{CAPTION} {worst.file}.", draw)]

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says of it, in SI units."""
        return {
            "halves": self.halves,
            "explained": self.explained,
            "verdict": self.text,
            "level": self.level,
            "runs": [run.to_dict() for run in self.runs],
        }


def validation_drawings(held_out: HeldOut | None) -> Iterator[Drawing]:
    """Yield the figure, where there was a validation."""
    if held_out is not None:
        yield from held_out.drawings()


def _chance(probability: float) -> str:
    return "< 0.0001" if probability < 1e-4 else fixed(probability, 4 if probability < 0.1 else 2)


RECORDED = {"measured": "measured_rms", "rms": "rms", "noise": "noise", "of_estimate": "of_estimate",
            "expected": "expected"}  # fmt: skip
RATIO = "error / expected"
EXPLAINED = "noise and the estimate's uncertainty"
ABOUT_CG = "Moments are about the centre of gravity: nothing tells the force. "
NOTE = (
    "Errors in the motion's band, each run's own offsets removed. By noise: as the residuals of the runs that predict "
    "have it. Probability: of such an error by chance, the least of the runs times their number. Runs of one body, as "
    "declared, are called badly predicted with a chance of 1 %. What all runs share, such as a wrong gain, is not seen."
)
BODY = "As another body: along what a change of mass, centre of gravity and tensor would do. 1 is to be expected."
CAPTION = (
    "Force and moment that the estimate has not seen: measured and predicted, the error below, over a short stretch. "
    "Grey: twice the expected root mean square. Right, the error's over the expected one; dashes: the largest of all "
    "that were held out. Of"
)
