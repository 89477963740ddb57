"""Draws the pictures of docs/tutorials: ``python docs/figures/gallery.py``, a minute on a free processor core."""

import io
import tempfile
from pathlib import Path

import jax
from PIL import Image

from identify.figure_style import COLUMN
from uq import Experiment, identify_files, montecarlo, paper, simulate

DOCS = Path(__file__).parents[1]


def draw():
    """Every picture by the name of its file."""
    preset, robot, short = (
        Experiment.load(name)
        for name in ("barreto2016", DOCS / "experiments" / "robot.toml", DOCS / "experiments" / "t1-10s.toml")
    )
    yield "first-result", montecarlo(preset, trials=100, trajectories="T1").figures()["groups-T1-central"]
    yield "robot-sources", montecarlo(robot, trials=200).figures()["sources-wrist-smoothed"]
    figures = paper(trials=200).figures()
    for name in ("figure4-simple-motions", "figure5-trajectories-central"):
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
