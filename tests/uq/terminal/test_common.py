"""What a command writes depends on what it is asked alone."""

import matplotlib

from tests.helpers.small_campaign import campaign
from uq.report.report_files import files
from uq.terminal.common import finish


def test_figures_of_a_command_follow_no_settings_of_the_working_folder(tmp_path):
    """A matplotlibrc there sets what is set here; in Python, the figures follow it."""
    result = campaign(1, ("T1",))
    finish(result, tmp_path / "plain")
    with matplotlib.rc_context({"savefig.dpi": 1, "axes.facecolor": "red", "figure.constrained_layout.use": True}):
        finish(result, tmp_path / "folder")
        figures = files(result)
    plain, folder = (
        {path.name: path.read_bytes() for path in (tmp_path / name).iterdir()} for name in ("plain", "folder")
    )
    assert folder == plain
    assert figures["breakdown-T1-central.svg"] != plain["breakdown-T1-central.svg"]
