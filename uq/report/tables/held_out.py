"""The view of a held-out prediction: errors by axis and by run beside what explains them."""

from identify.display.reporting import Drawing
from identify.display.rounding import fixed, significant, with_uncertainty
from identify.display.text_tables import Table
from identify.results.held_out_result import FORCE, MOMENT, HeldOut
from uq.report.drawing import drawing


def title(_: HeldOut) -> str:
    """Return what was done."""
    return "Held-out prediction"


def tables(result: HeldOut) -> list[Table]:
    """Return errors by axis over all runs, and by run."""
    return [_by_axis(result), _by_run(result)]


def notes(result: HeldOut) -> list[str]:
    """Return the verdict."""
    return [result.text]


def _by_axis(result: HeldOut) -> Table:
    rows = []
    for record in result.records():
        figures = (record[key] for key in ("measured", "rms", "noise", "of_estimate", "expected"))
        unit = "N" if record["row"] in FORCE else "N·m"
        ratio = with_uncertainty(record["ratio"], record["ratio_standard_uncertainty"])
        rows.append([f"{record['row']}, {unit}", *map(significant, figures), ratio, _chance(record["probability"])])
    head = ["rms", "measured", "error", "by noise", "by the estimate", "expected", RATIO, "probability"]
    which = f"each {'half' if result.halves else 'run'} by the other{'s' if len(result.runs) > 2 else ''}"
    about = "" if len(result.names) > len(MOMENT) else ABOUT_CG
    verdict = result.text[0].upper() + result.text[1:]
    return Table(f"Force and moment predicted, {which}", head, rows, f"{about}{verdict}. {NOTE}")


def _by_run(result: HeldOut) -> Table:
    rows = [
        [run.file, *(fixed(ratio, 2) for ratio in run.ratio), fixed(run.body_ratio, 2), _chance(run.least[0])]
        for run in result.runs
    ]
    head = ["", *result.names, "as another body", "least probability"]
    return Table("Error over what is expected", head, rows, BODY)


def drawings(result: HeldOut) -> list[Drawing]:
    """Return measured and predicted, of the run that is predicted worst."""
    worst = min(result.runs, key=lambda run: run.least[0])
    ratios = [max(run.ratio[k] for run in result.runs) for k in range(len(result.names))]
    return [drawing("validation", f"{CAPTION} {worst.file}.", "held_out.prediction", worst, ratios)]


def _chance(probability: float) -> str:
    return "< 0.0001" if probability < 1e-4 else fixed(probability, 4 if probability < 0.1 else 2)


RATIO = "error / expected"
ABOUT_CG = "Moments are about the centre of gravity: the force is not determined. "
NOTE = (
    "Errors in the motion's band, each run's own offsets removed. By noise: as the residuals of the runs that predict "
    "have it. Probability: of such an error by chance, the least of the runs times their number. Runs of one body, as "
    "declared, are called badly predicted with a chance of 1 %. What all runs share, such as a wrong gain, is not seen."
)
BODY = "As another body: along what a change of mass, centre of gravity and tensor would do. 1 is expected."
CAPTION = (
    "Force and moment that the estimate has not seen: measured and predicted, the error below, over a short stretch. "
    "Grey: twice the expected root mean square. Right, the error's over the expected one; dashes: the largest of all "
    "that were held out. Of"
)
