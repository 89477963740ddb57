"""``inertia identify``: the tensor from recorded runs."""

import argparse

from identify.estimation import methods
from rig.exceptions import on_one_line
from uq.bodies import export_formats
from uq.cli.terminal.command_parser import CommandParser
from uq.cli.terminal.common import finish, output_folder, show, start_jax
from uq.cli.terminal.options import add_window_options, whole_number
from uq.cli.terminal.terminal_bar import TerminalBar, say
from uq.files.mistakes import ExperimentError
from uq.jobs.body_request import BodyRequest
from uq.report.certificate.certificate import Certificate
from uq.runs.identification.identify_files import mounting_names
from uq.runs.recorded.time_window import windows_of_options

KEYS = ("runs", "experiment", "method", "centre", "tare", "mounting", "expected", "export")
"""Options that a job states in its file."""
ALONE = ("estimator", "offsets", "tare_centre", "validate", "limits", "force")
"""Options that no job states."""


def configure(parser: CommandParser) -> None:
    """Add the command's arguments."""
    parser.value("runs", "RUN.mcap", "recorded runs of one body", nargs="*")
    parser.value("--experiment", "E.toml", "r_CG, estimators, channels; or the preset barreto2016")
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
    parser.value("--jobs", "JOBS.toml", "many bodies, each with its runs and its experiment, in a folder of --out each")
    parser.value("--processes", "N", "most jobs or runs at a time (as many as there are cores)", type=whole_number)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    if arguments.processes is not None and arguments.processes < 1:
        raise ExperimentError(f"--processes is {arguments.processes}: give 1 or more")
    if arguments.jobs is not None:
        return _run_jobs(arguments)
    if not arguments.runs or arguments.experiment is None:
        missing = "--experiment is" if arguments.runs else "runs are"
        raise ExperimentError(f"{missing} missing: give RUN.mcap and --experiment E.toml, or --jobs JOBS.toml")
    start_jax()
    if arguments.export is not None and arguments.out is None:
        raise ExperimentError("--export has no folder: add --out DIR")
    if arguments.force and arguments.export is None:
        raise ExperimentError("--force is for --export, which is not given: add --export FORMATS")
    request = BodyRequest(
        runs=arguments.runs, experiment_file=arguments.experiment, estimator=arguments.estimator,
        offsets=arguments.offsets, method=arguments.method, windows=windows_of_options(arguments.limits),
        mountings=None if arguments.mounting is None else mounting_names(arguments.mounting),
        centre=arguments.centre, tare=arguments.tare, tare_centre=arguments.tare_centre, expected=arguments.expected,
        formats=() if arguments.export is None else export_formats.chosen(arguments.export), force=arguments.force,
        validate=arguments.validate, processes=arguments.processes,
    )  # fmt: skip
    request.check()
    with output_folder(arguments.out) as out:
        with TerminalBar(unit="runs") as bar:
            result = request.identified(bar)
        finish(Certificate(result), out, *request.compared(result), *request.exported(result))
    return 0


def _run_jobs(arguments: argparse.Namespace) -> int:
    """Identify the bodies of a file of jobs; 1: one failed, or its runs contradict what is declared."""
    given = [name for name in (*KEYS, *ALONE) if getattr(arguments, name)]
    if given:
        option = {"runs": "RUN.mcap", "limits": "--from and --to"}.get(given[0], f"--{given[0].replace('_', '-')}")
        cure = f"write it in {arguments.jobs}" if given[0] in KEYS else "identify that body without --jobs"
        raise ExperimentError(f"{option} beside --jobs: {cure}, or remove it")
    if arguments.out is None:
        raise ExperimentError("--jobs has no folder: add --out DIR")
    from uq.jobs.identify_jobs import identify_jobs  # a single body waits for no page
    from uq.jobs.jobs_file import load_jobs
    from uq.jobs.summary import findings, table

    order = [job.name for job in load_jobs(arguments.jobs)]
    start_jax()
    with output_folder(arguments.out) as out, TerminalBar(unit="jobs") as bar:
        results = []
        again = "the same command continues: what is complete is kept"
        try:
            for result in identify_jobs(arguments.jobs, str(out), processes=arguments.processes, progress=bar):
                results.append(result)
                if result.note:
                    say(result.note)
        except KeyboardInterrupt as error:
            raise KeyboardInterrupt(again) from error
    results.sort(key=lambda result: order.index(result.name))
    show(None, table(results))
    print("", *map(on_one_line, findings(results)), sep="\n")
    print(f"\n{on_one_line(f'summary.csv, summary.html and a folder for each job are in {arguments.out}')}")
    return int(any(result.verdict in ("failed", "contradicted") for result in results))
