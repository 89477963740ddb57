"""The second process's work: reads a growing recording and says, block by block, what the run tells of the tensor.

Before a recording it checks that the experiment fits the rig: the channels that it needs, and their meaning.
"""

from pathlib import Path
from typing import Any

import numpy as np

from identify.display.text_tables import counted
from identify.signals.run import RunError
from rig import channels
from rig.bags.growing_file import GrowingFile
from rig.channels import ImuChannel, WrenchChannel
from rig.mcap.message_definitions import IMU, WRENCH
from rig.record.recorder import MEANING
from rig.record.rig_file import Rig, load_rig
from uq.experiment.experiment import Experiment, ExperimentError
from uq.runs.identification.systematic_errors import nodes_of
from uq.runs.live.estimate_lines import block_of, line_of
from uq.runs.live.growing_run import GrowingRun
from uq.runs.live.live_estimate import LiveEstimate, estimated, sources_in
from uq.runs.live.running_sums import RunningSums
from uq.runs.recorded.declared_channels import declared

CONFIRMED = 2
"""Estimates in a row that must reach a target: one alone may do so by chance."""


class LiveEstimator:
    """Reads what has come and estimates anew when a block is whole.

    Attributes:
        reached: whether the target is reached.
    """

    def __init__(
        self,
        rig: str | Path,
        experiment: str | Path,
        run: str | Path,
        target: float | None = None,
    ) -> None:
        """Check that experiment and rig fit together; the run's file may not exist yet.

        Args:
            rig: the rig file.
            experiment: the experiment file, or the name of a preset.
            run: the file that the recording grows in.
            target: half the interval of 95 % that every component is to have at most [kg·m²]; None: none.

        Raises:
            ExperimentError, RigError, RunError: one of the files cannot be used, or they contradict each other.
        """
        self._experiment, self._target = Experiment.load(experiment), target
        estimator = self._experiment.estimator()
        self._experiment.stated_r_cg  # noqa: B018 - says at once where there is none
        topics = topics_of(load_rig(rig), self._experiment, Path(run))
        nodes = nodes_of(sources_in(self._experiment))
        self._file = GrowingFile(run, {WRENCH: topics[0], IMU: topics[1]})
        delay = float(abs(nodes).max())
        gravity = self._experiment.gravity
        self._run = GrowingRun(Path(run), self._experiment.recording, estimator, topics, gravity=gravity, delay=delay)
        self._sums = RunningSums(estimator, nodes)
        self._in_a_row = 0

    @property
    def ended(self) -> bool:
        """Whether the recorder has finished the file."""
        return self._file.ended

    @property
    def reached(self) -> bool:
        """Whether the target has been reached, ``CONFIRMED`` times in a row."""
        return self._in_a_row >= CONFIRMED

    def step(self) -> LiveEstimate | None:
        """Take what has come; return the estimate where a block is whole, else None.

        Raises:
            RigError: the file is damaged.
            OSError: it cannot be read.
        """
        self._run.add(self._file.take())
        new = False
        for block in self._run.blocks(self._file.definitions.metadata, ended=self._file.ended):
            try:
                self._sums.add(block)
            except (RunError, ValueError) as error:
                self._run.troubles.append(str(error))
            new = True
        if not new or not self._sums.products[0, 0]:
            return None
        estimate = estimated(self._sums, self._experiment)
        below = self._target is not None and bool((estimate.half_width <= self._target).all())
        self._in_a_row = self._in_a_row + 1 if below else 0
        return estimate

    def warnings(self) -> list[str]:
        """Return what a reader of the estimate should know."""
        left_out = [f"{counted(count, 'sample')} {reason} left out" for reason, count in self._sums.left_out.items()]
        return [*self._run.troubles[-1:], *left_out, *list(self._sums.warnings)[-1:]]

    def message(self, estimate: LiveEstimate) -> dict[str, Any]:
        """Return an estimate for the recording's process: lines to show, whether the target is reached."""
        return {
            "block": block_of(estimate, self._target, self.warnings()),
            "line": line_of(estimate, self._target),
            "reached": self.reached,
            "seconds": estimate.seconds,
        }


SENSORS = {"wrench": ("wrench_topic", "load cell"), "imu": ("motion_topic", "IMU")}
"""Key of ``[recording]`` that names the topic of a device, and the device's name, by what it measures."""


def topics_of(rig: Rig, experiment: Experiment, path: Path) -> tuple[str, str]:
    """Return the topics of load cell and IMU that a live estimate takes.

    Args:
        rig: what will be recorded.
        experiment: what it will be identified with.
        path: of the file to come, for messages.

    Raises:
        ExperimentError: the rig has no such sensor, or several and none is named; a weight that was removed.
        RunError: what the rig records contradicts the experiment's ``[recording]``.
    """
    recording = experiment.recording
    if recording.removes_weight:
        raise ExperimentError(
            f"recording.compensated is {recording.compensated}, and the weight can be put back only when the run is "
            "over: record without --identify"
        )
    (wrench, frame), (imu, _) = (
        _topic_and_frame(rig, measures, getattr(recording, key)) for measures, (key, _) in SENSORS.items()
    )
    nothing, none = np.zeros(0, np.int64), np.zeros((0, 3))
    facts = MEANING | {f"{entry.name}.{key}": text for entry in rig.entries for key, text in entry.settings.items()}
    facts |= {f"{entry.name}.topic": entry.topic for entry in rig.entries}
    bag = channels.Recording(
        path, "", {"rig.run": facts},
        WrenchChannel(topic=wrench, frame_id=frame, log_time=nothing, stamp=nothing, force=none, moment=none),
        ImuChannel(
            topic=imu, frame_id="body", log_time=nothing, stamp=nothing, angular_velocity=none,
            linear_acceleration=none,
        ),
    )  # fmt: skip
    declared(bag, recording)
    return wrench, imu


def _topic_and_frame(rig: Rig, measures: str, named: str | None) -> tuple[str, str]:
    key, sensor = SENSORS[measures]
    topics = {
        topic: entry.frame_id
        for entry in rig.entries
        for channel, topic in zip(entry.device.channels, entry.topics, strict=True)
        if channel.measures == measures
    }
    if not topics:
        raise ExperimentError(f"{rig.path} has no {sensor}: --identify needs load cell and IMU")
    if named is None and len(topics) > 1:
        raise ExperimentError(
            f"{rig.path} has {len(topics)} of {sensor}: name one of {', '.join(topics)} as recording.{key}"
        )
    if named is not None and named not in topics:
        raise ExperimentError(
            f"recording.{key} is {named}, which no {sensor} of {rig.path} has: it has {', '.join(topics)}"
        )
    chosen = named or next(iter(topics))
    return chosen, topics[chosen]
