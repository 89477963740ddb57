"""Draws the pictures of the pages: ``python docs/figures/gallery.py [NAME ...]``, all of them in two minutes.

The certificate is printed by Chromium and read by Poppler (``apt-get install chromium poppler-utils``).
"""

import argparse
import io
import re
import subprocess
import tempfile
import tomllib
from collections.abc import Callable
from functools import cache
from pathlib import Path

import jax
import matplotlib
from frames import draw as frames
from PIL import Image

from uq import Certificate, Experiment, budget, identify_files, montecarlo, paper, simulate
from uq.report.figures.paper import rates, spheres
from uq.report.figures.style import COLUMN, STYLE
from uq.report.report_files import report

DOCS = Path(__file__).parents[1]


@cache
def example(name):
    """One of the shipped experiment files."""
    return Experiment.load(DOCS.parent / "uq" / "examples" / f"{name}.toml")


def recorded(seeds, folder):
    """Runs of the example ``t1-10s``, one a seed."""
    paths = [Path(folder) / f"{chr(ord('a') + k)}.mcap" for k in range(len(seeds))]
    for seed, path in zip(seeds, paths, strict=True):
        simulate(example("t1-10s"), seed=seed).write(path)
    return paths


@cache
def identified(*seeds, mountings=None):
    """What ``inertia identify`` makes of them."""
    with tempfile.TemporaryDirectory() as folder:
        return identify_files(recorded(seeds, folder), example("t1-10s"), mountings=mountings)


papers = cache(paper)


def two_spheres():
    """Angular velocity and angular acceleration of the paper's motion T1, side by side."""
    _, omega, alpha = rates(Experiment.load("barreto2016").trajectories["T1"])
    with matplotlib.rc_context(STYLE):
        figure = spheres(omega, alpha)
    figure.set_size_inches(7.2, 3.2)
    for place, axes in zip((0.0, 0.5), figure.axes, strict=True):
        axes.set_position((place, 0.06, 0.46, 0.88))
    return figure


def certificate():
    """First page of the certificate of five runs, with the particulars of docs/how-to/certificate.md."""
    (particulars,) = re.findall(
        r"```toml\n(\[report\]\n.*?)```", (DOCS / "how-to" / "certificate.md").read_text("utf-8"), re.S
    )
    experiment = Experiment.from_dict(example("t1-10s").document | tomllib.loads(particulars))
    with tempfile.TemporaryDirectory() as folder:
        runs = recorded(range(5), folder)
        page, printed = Path(folder, "report.html"), Path(folder, "certificate.pdf")
        page.write_text(report(Certificate(identify_files(runs, experiment))), "utf-8")
        browser = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder}/profile"]
        browser += ["--no-pdf-header-footer", f"--print-to-pdf={printed}", page.as_uri()]
        subprocess.run(browser, check=True, capture_output=True)
        first = ["pdftoppm", "-r", "85", "-l", "1", "-png", str(printed)]
        return Image.open(io.BytesIO(subprocess.run(first, check=True, capture_output=True).stdout))


PICTURES: dict[str, Callable] = {
    "budget.png": lambda: budget(Experiment.load("barreto2016"), trials=300).figures()["budget"],
    "robot-sources.png": lambda: montecarlo(example("robot")).figures()["breakdown-wrist-smoothed"],
    "breakdown.png": lambda: papers().campaign.figures()["breakdown-T1-central"],
    "figure3.png": lambda: papers().figures()["figure3-groups-T1-central"],
    "figure4.png": lambda: papers().figures()["figure4-simple-motions"],
    "figure5.png": lambda: papers().figures()["figure5-trajectories-central"],
    "spheres.png": two_spheres,
    "recording-residuals.png": lambda: identified(0).figures()["residuals"],
    "recording-coverage.png": lambda: identified(0).figures()["coverage"],
    "identify-budget.png": lambda: identified(1, 2, 3, mountings=("A", "A", "B")).figures()["budget"],
    "identify-runs.png": lambda: identified(1, 2, 3, mountings=("A", "A", "B")).figures()["runs"],
    "certificate.png": certificate,
    "frames.svg": frames,
}
"""How each picture of the pages is made."""


def written(drawn, path):
    """Write a figure or a picture: PNG with few colours, which is small, or SVG whose letters are drawn."""
    if path.suffix == ".svg":
        with matplotlib.rc_context({"svg.hashsalt": "inertia-uq", "svg.fonttype": "path"}):
            drawn.savefig(path, metadata={"Date": None})
        return
    if not isinstance(drawn, Image.Image):
        data = io.BytesIO()
        drawn.savefig(data, dpi=150 if drawn.get_figwidth() > COLUMN else 200)
        drawn = Image.open(data)
    small = drawn.convert("RGB").quantize(256, kmeans=3, dither=Image.Dither.NONE)
    small.save(path, optimize=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=list(PICTURES), metavar="NAME", help="of pictures (all)")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="folder (docs/figures)")
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    for name in arguments.names:
        written(PICTURES[name](), arguments.out / name)
        print(arguments.out / name)
