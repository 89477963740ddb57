"""Draws the pictures of docs/tutorials: ``python docs/figures/gallery.py``, a minute on a free processor core."""

import io
import tempfile
from pathlib import Path

import jax
from PIL import Image

from uq import Experiment, budget, identify_files, montecarlo, paper, simulate
from uq.report.figures.style import COLUMN

DOCS = Path(__file__).parents[1]


def draw():
    """Every picture by the name of its file."""
    robot, short = (Experiment.load(DOCS.parent / "uq" / "examples" / f"{name}.toml") for name in ("robot", "t1-10s"))
    yield "budget", budget(Experiment.load("barreto2016"), trials=300).figures()["budget"]
    yield "robot-sources", montecarlo(robot).figures()["breakdown-wrist-smoothed"]
    result = paper()
    yield "breakdown", result.campaign.figures()["breakdown-T1-central"]
    figures = result.figures()
    for name in ("figure3-groups-T1-central", "figure4-simple-motions", "figure5-trajectories-central"):
        yield name.split("-")[0], figures[name]
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run.mcap"
        simulate(short).write(run)
        figures = identify_files([run], short).figures()
    for name in ("residuals", "coverage"):
        yield f"recording-{name}", figures[name]


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    for name, figure in draw():
        data = io.BytesIO()
        figure.savefig(data, dpi=150 if figure.get_figwidth() > COLUMN else 200)
        small = Image.open(data).convert("RGB").quantize(256, kmeans=3, dither=Image.Dither.NONE)  # smaller
        small.save(Path(__file__).with_name(f"{name}.png"), optimize=True)
