"""``inertia identify``: the tensor from recorded runs."""

import argparse

from identify.display.reporting import Result
from identify.estimation import methods
from uq.bodies import export_formats
from uq.cli.terminal.command_parser import CommandParser
from uq.cli.terminal.common import finish, output_folder, start_jax
from uq.cli.terminal.options import add_window_options
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.report.certificate.certificate import Certificate
from uq.runs.identification.identify_files import identify_files, mounting_names
from uq.runs.identification.tare import check_tare, tare_files
from uq.runs.recorded.time_window import windows_of_options


def configure(parser: CommandParser) -> None:
    """Add the command's arguments."""
    parser.value("runs", "RUN.mcap", "recorded runs of one body", nargs="+")
    parser.value("--experiment", "E.toml", "r_CG, estimators, channels; or the preset barreto2016", required=True)
    parser.value("--estimator", "NAME", "the estimator (recording.estimator, or the first)")
    parser.add_argument(
        "--offsets",
        choices=("estimate", "still", "none"),
        help="constant offsets of force and moment: estimated, from rest, or none (as the experiment says)",
    )
    parser.value(
        "--mounting", "A,A,B,…",
        text="name of the mounting that each run was made with, in the runs' order (as the runs' metadata say)",
    )  # fmt: skip
    parser.value("--centre", "centre.json", "mass and centre of gravity from static poses (inertia centre --out)")
    parser.value(
        "--tare", "EMPTY.mcap", nargs="+", action="extend", default=[],
        text="runs of the fixture alone, whose mass, centre of gravity and tensor are taken off",
    )  # fmt: skip
    parser.value("--tare-centre", "centre.json", "the fixture's centre, instead of [fixture]")
    parser.add_argument(
        "--method",
        choices=methods.names(),
        help="source: least squares of the moment; gls: the same, weighted by the residuals' covariance where that can "
        "be trusted; joint: tensor, mass, centre, offsets, delay and rotation together (recording.method)",
    )
    parser.switch(
        "--validate",
        "predict force and moment of each run by the others (of one run: of each half), and judge the errors",
    )
    add_window_options(parser)
    parser.value("--expected", "BODY.toml", "a reference body, from its drawing or a CAD report")
    formats = ", ".join(export_formats.names())
    parser.value("--export", "FORMATS", f"export formats, separated by commas: {formats}")
    parser.switch(
        "--force", "export even a tensor that is physically impossible or that the runs contradict, with a warning"
    )
    parser.value("--out", "DIR", "folder for result.json, report.html and the figures")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    start_jax()
    if arguments.export is not None and arguments.out is None:
        raise ExperimentError("--export has no folder: add --out DIR")
    if arguments.force and arguments.export is None:
        raise ExperimentError("--force is for --export, which is not given: add --export FORMATS")
    formats = None if arguments.export is None else export_formats.chosen(arguments.export)
    experiment = Experiment.load(arguments.experiment)
    reference = None
    if arguments.expected is not None:
        from uq.bodies.reference import load_reference

        reference = load_reference(arguments.expected)
    check_tare(arguments.tare, experiment, arguments.tare_centre, arguments.method)
    with output_folder(arguments.out) as out:
        choices = {name: getattr(arguments, name) for name in ("estimator", "offsets", "method")}
        mountings = None if arguments.mounting is None else mounting_names(arguments.mounting)
        result = identify_files(
            arguments.runs, experiment, windows=windows_of_options(arguments.limits), mountings=mountings,
            centre=arguments.centre, validate=arguments.validate, **choices,
        )  # fmt: skip
        result = tare_files(result, arguments.tare, experiment, tare_centre=arguments.tare_centre, **choices)
        more: list[Result] = []
        if reference is not None:
            from uq.bodies.comparison import compare

            more.append(compare(result, reference))
        if formats is not None:
            from uq.bodies.export import export

            more.append(export(result, formats, force=arguments.force))
        finish(Certificate(result), out, *more)
    return 0
