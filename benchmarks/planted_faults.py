"""Whether the tests see an error: some sixty faults planted one by one in a copy of the tree, and the tests run on it.

Each fault is a change of a piece of source text, found by the text wherever its file stands, so that the same faults
can be planted in another version. The tests that stand nearest run first, the others only where these see nothing.
All tests must pass without a fault, which `make test` shows.

    python -m benchmarks.planted_faults [--tree DIR] [--only NAME ...] [--tests near|all] [--check]
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

PACKAGES = ("identify", "uq", "rig")
LONGEST = 3600
"""Seconds after which tests that a fault keeps from ending are stopped; the fault counts as seen."""


class Fault(NamedTuple):
    """A change of the source that alters what it computes."""

    name: str
    reason: str
    changes: tuple[tuple[str, str], ...]
    """Text and what replaces it; several where versions write it differently. One of them must occur, exactly once."""
    near: tuple[str, ...]
    """File names of the tests that stand nearest, of any version."""


def fault(name: str, reason: str, near: str, *changes: tuple[str, str]) -> Fault:
    """Return a fault; ``near`` holds stems of test files."""
    return Fault(name, reason, changes, tuple(f"test_{stem}.py" for stem in near.split()))


FAULTS = (
    fault("acting_error", "an error that is drawn by its act alone, twice as large", "extending",
          ("omega + added[6:9])", "omega + 2 * added[6:9])")),
    # identify: the ledger
    fault("ledger_draws", "drawn errors added in squares, not trial by trial", "ledger",
          ("return np.sum(drawn, axis=0) if drawn else None",
           "return np.sqrt(np.sum(np.square(drawn), axis=0)) if drawn else None")),
    fault("ledger_tiers", "errors of typical size in the 95 % interval", "ledger",
          ('distributed = self.of_tiers("measured", "declared")',
           'distributed = self.of_tiers("measured", "declared", "typical")')),
    fault("ledger_contradicted", "what runs contradict, and typical errors, without their factor of 2", "ledger",
          ("shift = CONVENTIONAL * u[:, None]", "shift = u[:, None]")),
    fault("ledger_key", "a row beside that whose place it takes", "ledger",
          ("if row.key not in keys), *added)", "if row), *added)")),
    fault("ledger_freedom", "squares for fourth powers in Welch and Satterthwaite", "certificate_figures ledger",
          ("scale**4 / freedom", "scale**2 / freedom")),
    fault("ledger_expected", "an expected error on the other side of the interval", "ledger declared_errors",
          ("np.maximum(np.outer(expected, [1, -1]), 0.0)", "np.maximum(np.outer(expected, [-1, 1]), 0.0)")),
    fault("ledger_scatter", "residuals counted in the scatter, too", "type_a ledger",
          ("np.sqrt(self.excess**2 - 1)[:, None]", "self.excess[:, None]")),
    fault("tare_shared", "a fixture's share of an error of the rig added, not taken off", "ledger tare",
          ("changes=row.changes + same.changes", "changes=row.changes - same.changes")),
    # identify: errors of the rig, the judge of all runs
    fault("error_turn", "a gyro turned the other way round", "error_models",
          ("to_gyro = exponential(turn)", "to_gyro = exponential(-turn)")),
    fault("error_clock", "an IMU's clock that runs fast where it runs slow", "error_models",
          ("rate = 1 - np.gradient(seconds", "rate = 1 + np.gradient(seconds")),
    fault("error_belief", "a belief that errs with the sign of what it is of", "error_models",
          ("getattr(self.beliefs, name) - error}", "getattr(self.beliefs, name) + error}")),
    fault("judge_agrees", "a cause of the rig on which the runs do not agree", "runs_together",
          ("* len(further) > UNLIKE", "* len(further) >= 0.0")),
    # identify: rigid body, motion, signals
    fault("regressor", "sign of a product of omega in Omega_R", "regressor gram",
          ("[a1, a2 - w13, a3 + w12,", "[a1, a2 + w13, a3 + w12,")),
    fault("parallel_axis", "sign of Huygens–Steiner's outer product", "inertia",
          ("jnp.dot(offset, offset) * jnp.eye(3) - jnp.outer", "jnp.dot(offset, offset) * jnp.eye(3) + jnp.outer"),
          ("xp.dot(offset, offset) * xp.eye(3) - xp.outer", "xp.dot(offset, offset) * xp.eye(3) + xp.outer")),
    fault("magnus", "factor of the commutator in the attitude's step", "trajectory",
          ("(np.sqrt(3) / 12 * h**2)[:, None]", "(np.sqrt(3) / 6 * h**2)[:, None]"),
          ("(np.sqrt(3) / 12 * step**2)[:, None]", "(np.sqrt(3) / 6 * step**2)[:, None]")),
    fault("leg_gravity", "gravity's sign in the legs' forces", "platform stewart_platform",
          ("gravity * jnp.array([0.0, 0.0, 1.0])", "gravity * jnp.array([0.0, 0.0, -1.0])")),
    fault("leg_range", "whole range of a leg taken for half of it", "platform_motion leg_limits",
          ("np.where(finite, (high - low) / 2, np.inf)", "np.where(finite, high - low, np.inf)")),
    fault("differentiator", "off by one in the Savitzky–Golay window's step", "differentiate",
          ("derivative=1)[half + 1 :] * rate / half", "derivative=1)[half + 1 :] * rate / (half + 1)"),
          ("weights[half + 1 :] * rate / half", "weights[half + 1 :] * rate / (half + 1)")),
    fault("segment_end", "off by one at the end of a segment", "stretches segments",
          ("(start / rate, (stop - 1) / rate)", "(start / rate, stop / rate)")),
    fault("spectrum_window", "off by one at the end of the spectrum's window", "gls generalised_least_squares",
          ("np.clip(position + half + 1, begin + 1, m)", "np.clip(position + half, begin + 1, m)")),
    # identify: estimators, joint, static, diagnostics
    fault("lever", "sign of r × F in the right side", "solve excitation gram",
          ("sums.moment - jnp.cross(r_cg, sums.force)", "sums.moment + jnp.cross(r_cg, sums.force)"),
          ("sums.moment - xp.cross(r_cg, sums.force)", "sums.moment + xp.cross(r_cg, sums.force)")),
    fault("rest_covariance", "variance of one block taken for that of their mean",
          "offsets recorded identify_files identify identification",
          ("- means) / free / len(means)", "- means) / free"),
          ("- mean) / free / len(means)", "- mean) / free")),
    fault("calibrated_mean", "a result is not corrected by the means of its calibration", "calibrate_files",
          ("replace(result, value=result.value - shift), rows", "result, rows")),
    fault("calibrated_apart", "correlated errors of a calibration are one row each", "calibrate_files",
          ("members.setdefault(sets.get(source.name, source.name), [])", "members.setdefault(source.name, [])")),
    fault("calibrated_poses", "static poses are corrected by a calibration in the wrong direction", "calibrate_files",
          ("force - expected[:, :3], moment - expected[:, 3:]", "force + expected[:, :3], moment + expected[:, 3:]")),
    fault("crossed_noise", "what two noises make together is drawn with one of them", "source_budget",
          ("_cell_normals(engine, draws, case, k) if moving and engine.crossed.names else draws.cell", "draws.cell")),
    fault("joint_delay", "sign of the delay in the joint model", "joint joint_estimator",
          ('self.t + self.x["delay"][0]', 'self.t - self.x["delay"][0]')),
    fault("centre_derivative", "sign of the centre's derivative by mass", "centre static_centre static_poses pose_fit",
          ("by[1:4, 0] = -r_cg / mass", "by[1:4, 0] = r_cg / mass"),
          ("jacobian[1:4, 0] = -r_cg / mass", "jacobian[1:4, 0] = r_cg / mass")),
    fault("poses_alike", "skipped: poses tilted about one axis only", "centre static_centre static_poses pose_fit",
          ("if spread[1] < LEAST_TILT:", "if spread[0] < LEAST_TILT:")),
    fault("consistency_unit", "a rotation said in radians for degrees", "moment_alone",
          ('imu_rotation_to_body",\n        every(180 / np.pi', 'imu_rotation_to_body",\n        every(1.0')),
    # uq: units, experiment, sources
    fault("gravity_unit", "g as an acceleration taken for gram", "units imports import_table",
          ('"standard_gravity" if (name, unit) == ("g", "m/s^2") else name', "name")),
    fault("triangle_check", "skipped: moments that break the triangle inequality",
          "expected_input reference experiment",
          ("if low <= 0 or low + middle < high * (1 - 1e-12):", "if low <= 0:")),
    fault("half_width", "half-width of a triangular source over its standard deviation", "source_table source_draws",
          ("ratio = np.sqrt(6)", "ratio = np.sqrt(3)")),
    fault("block_of_draws", "every block of a trial draws the same numbers", "normals random_normals source_draws",
          ("(jnp.asarray(block).astype(jnp.uint32) + zero, place)", "(zero, place)")),
    fault("quantisation", "rounded down instead of to the nearest step", "sources",
          ("step * jnp.round(signal / jnp.where(step > 0, step, 1))",
           "step * jnp.floor(signal / jnp.where(step > 0, step, 1))")),
    # uq: trials
    fault("halo", "off by one: a sample without a derivative counts", "reference_trial sums_engine noise_moments",
          ("(index >= halo) & (index < n - halo)", "(index >= halo) & (index <= n - halo)")),
    fault("overlapping_block", "a record's last block counts samples of the one before again",
          "reference_trial sums_engine",
          ("(start + jnp.arange(size) >= first)", "(start + jnp.arange(size) >= start)")),
    fault("acting_noise", "the gyro's noise acts in every case", "chooser campaign",
          ("jnp.tensordot(engine.gyro.acts[:, case],", "jnp.tensordot(jnp.ones_like(engine.gyro.acts[:, case]),")),
    fault("case_order", "cases by samples and on sums in the order of their engines", "chooser",
          ("places = {case: k for k, case in enumerate([*summed, *sampled, *same])}",
           "places = {case: k for k, case in enumerate(cases)}")),
    fault("gyro_limit", "per cent of the motion taken for parts", "chooser",
          ("if ratio > LARGEST_NOISE:", "if ratio > 100 * LARGEST_NOISE:")),
    fault("campaign_seed", "a checkpoint of another seed goes on", "checkpoint campaign",
          ('            "seed": self.seed,\n            **self.settings',
           '            "seed": 0,\n            **self.settings')),
    fault("trial_numbers", "every segment repeats the first trials", "montecarlo campaign checkpoint",
          ("np.arange(self.count, self.count + segment)", "np.arange(segment)"),
          ("np.arange(self.count, self.count + stretch)", "np.arange(stretch)")),
    fault("checkpoint_owner", "skipped: a part of another campaign", "checkpoint",
          ('if header.get("campaign") != self.digest:', 'if header["campaign"] is None:')),
    fault("lagged_covariance", "a differentiator's response not reversed in a correlation", "noise_moments",
          ("np.convolve(first, second[::-1])", "np.convolve(first, second)")),
    # uq: propagation, coverage, sensitivity
    fault("welch_satterthwaite", "u² for u⁴ in the effective degrees of freedom", "linear law_of_propagation",
          ("np.sum(squares**2 / freedom[: squares.shape[1]], axis=1)",
           "np.sum(squares / freedom[: squares.shape[1]], axis=1)"),
          ("total += np.sum(squares**2 / freedom, axis=1)", "total += np.sum(squares / freedom, axis=1)")),
    fault("interval_rank", "off by one in the rank of an interval's end", "coverage coverage_intervals",
          ("max((len(y) - q + 1) // 2 - 1, 0)", "max((len(y) - q + 1) // 2, 0)")),
    fault("jansen", "factor of the total Sobol index", "sensitivity sobol_shapley",
          ("((both - others) ** 2 + (none - ones) ** 2) / 4", "((both - others) ** 2 + (none - ones) ** 2) / 2"),
          ("((both - others) ** 2 + (none - alone) ** 2) / 4", "((both - others) ** 2 + (none - alone) ** 2) / 2")),
    fault("twin_choice", "draws and twins of the budget's choices swapped", "budget source_budget",
          ("n if w >> k & 1 else n + mark", "n + mark if w >> k & 1 else n")),
    # uq: recorded runs, bodies, planning, design, certificate, commands
    fault("compensated", "sign of the weight that a driver removed", "recorded identify_files",
          ("weight = mass * experiment.gravity * upward(", "weight = -mass * experiment.gravity * upward(")),
    fault("tare_factor", "a body's degrees of freedom without the share of what it is made of", "ledger tare",
          ("(parts / np.asarray(freedom)).sum(axis=1) / total", "np.mean(1 / np.asarray(freedom))")),
    fault("export_millimetres", "an ABB load's centre in metres", "export exports",
          ("(MILLIMETRE * body.r_cg, quaternion)", "(body.r_cg, quaternion)")),
    fault("principal_slope", "missing factor of a product in a principal moment's derivative", "design",
          ("return np.array([x * x, 2 * x * y, 2 * x * z, y * y,", "return np.array([x * x, x * y, 2 * x * z, y * y,")),
    fault("guard_band", "skipped: the guard band of an acceptance", "certificate_figures certificate certificate_page",
          ("if low + guard <= value <= high - guard:", "if low <= value <= high:")),
    fault("exit_status", "a mistake on the command line ends with status 1", "commands campaign_command",
          ("self.exit(2)", "self.exit(1)")),
    # rig
    fault("device_time", "a load cell's microseconds taken for tenths",
          "rig_devices devices rig_oracles vendor_decoders",
          ("self._clock(microseconds) * 1000", "self._clock(microseconds) * 100")),
    fault("missing_samples", "off by one in the samples that a counter misses", "rig_devices devices",
          ("self.counts.missing += max(0, step - 1)", "self.counts.missing += max(0, step)"),
          ("max(0, self._counter - before - 1)", "max(0, self._counter - before)")),
    fault("summary_checksum", "off by one in the bytes that a summary's checksum covers", "rig_recover recover",
          ("data[start : last + 25]", "data[start : last + 24]")),
    fault("clock_offset", "the latest arrival of a short run taken for the earliest", "rig_clock device_clock",
          ("min(offset for _, offset in hull)", "max(offset for _, offset in hull)")),
    fault("delay_peak", "sign of the parabola that refines a delay's peak", "rig_clock device_clock",
          ("0.5 * (left - right) / (left - 2 * middle + right)", "0.5 * (right - left) / (left - 2 * middle + right)")),
)  # fmt: skip


def place(tree: Path, fault: Fault) -> tuple[Path, str, str]:
    """Return the file that holds a fault's text, the text and its replacement.

    Raises:
        SystemExit: the text occurs nowhere or more than once.
    """
    files = [path for package in PACKAGES for path in sorted((tree / package).rglob("*.py"))]
    texts = {path: path.read_text("utf-8") for path in files}
    places = [
        (path, before, after)
        for before, after in fault.changes
        for path, text in texts.items()
        for _ in range(text.count(before))
    ]
    if len(places) != 1:
        where = ", ".join(str(path.relative_to(tree)) for path, _, _ in places) or "no file"
        sys.exit(f"error: text of the fault '{fault.name}' is in {where}: give one that stands in one place")
    return places[0]


def planted(tree: Path, fault: Fault, copy: Path) -> None:
    """Copy what the tests need, with a fault in it."""
    hidden = shutil.ignore_patterns(".*", "__pycache__", "out", "shared")
    shutil.copytree(tree, copy, ignore=hidden, symlinks=True)
    for name in ("pyproject.toml", "Makefile"):
        shutil.copy(tree / name, copy / name)
    path, before, after = place(tree, fault)
    target = copy / path.relative_to(tree)
    target.write_text(target.read_text("utf-8").replace(before, after), "utf-8")


def run(copy: Path, tests: Sequence[str], cache: str, python: str) -> tuple[str, float]:
    """Run tests until one fails; return which did, or nothing, and the seconds it took."""
    environment = dict(os.environ, PYTHONPATH=str(copy), INERTIA_TEST_CACHE=cache)
    environment["PYTHONPYCACHEPREFIX"] = str(copy.parent / "bytecode")
    options = ["-x", "-q", "-p", "no:cacheprovider", "-m", "not study and not slow"]
    began = time.monotonic()
    try:
        done = subprocess.run(
            [python, "-m", "pytest", *options, *tests], cwd=copy, env=environment, capture_output=True, text=True,
            timeout=LONGEST, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return "stopped: no end", time.monotonic() - began
    seconds = time.monotonic() - began
    if done.returncode == 0:
        return "", seconds
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    if done.returncode not in (1, 2) or failed is None:
        sys.exit(f"error: pytest ended with status {done.returncode}:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return failed.group(1).removeprefix("tests/"), seconds


def tried(tree: Path, fault: Fault, python: str, cache: str, *, rest: bool) -> tuple[str, float]:
    """Plant a fault and run the tests: the near ones, then the rest."""
    with tempfile.TemporaryDirectory(prefix="planted-") as folder:
        copy = Path(folder) / "tree"
        planted(tree, fault, copy)
        first = [str(path.relative_to(copy)) for name in fault.near for path in (copy / "tests").rglob(name)]
        seen, seconds = run(copy, first, cache, python) if first else ("", 0.0)
        if not seen and rest:
            ignored = [f"--ignore={path}" for path in first]
            seen, more = run(copy, [*ignored, "tests"], cache, python)
            seconds += more
    return seen, seconds


def main() -> None:
    """Plant the faults and print what sees them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tree", type=Path, default=Path(__file__).parents[1], help="checkout that is tried")
    parser.add_argument("--python", default=sys.executable, help="interpreter with what the tests need")
    parser.add_argument("--only", action="append", help="name of a fault; repeatable")
    parser.add_argument("--tests", choices=("near", "all"), default="all", help="'near': not the rest")
    parser.add_argument("--check", action="store_true", help="only see that every text is in one place")
    arguments = parser.parse_args()
    tree = arguments.tree.resolve()
    chosen = [fault for fault in FAULTS if not arguments.only or fault.name in arguments.only]
    for fault in chosen:
        place(tree, fault)
    if arguments.check:
        print(f"{len(chosen)} faults, each text in one place")
        return
    with tempfile.TemporaryDirectory(prefix="planted-cache-") as folder:
        cache = os.environ.get("INERTIA_TEST_CACHE", folder)
        print("| fault | what is wrong | seen by | s |\n|---|---|---|---|", flush=True)
        count = 0
        for fault in chosen:
            seen, seconds = tried(tree, fault, arguments.python, cache, rest=arguments.tests == "all")
            count += bool(seen)
            print(f"| {fault.name} | {fault.reason} | {seen or '**nothing**'} | {seconds:.0f} |", flush=True)
    print(f"\n{count} of {len(chosen)} faults are seen")


if __name__ == "__main__":
    main()
