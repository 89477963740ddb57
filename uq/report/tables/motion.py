"""The view of an exported motion: its files, and how far each is from the motion."""

from identify.reporting import Section, uncaptioned
from identify.text_tables import Table, sentence
from uq.planning.motion_export import MEANING, MOOG_RATE, RATE, MotionExport


def tables(export: MotionExport) -> list[Table]:
    """Return each file, what it is, and how far it is from the motion."""
    differences = export.differences
    rows = [
        [name, KINDS[name.partition(".")[2]], f"{differences[name]:.1e}" if name in differences else "–"]
        for name in export.contents
    ]
    return [Table(_caption(export), ["file", "what", "off by, m or rad"], rows, FILES)]


overview = uncaptioned


def section(export: MotionExport) -> Section:
    """Return its part of a report."""
    meaning = [sentence(text) for text in (MEANING["frames"], MEANING["rotation"])]
    return Section(_caption(export), details=tables(export), assumptions=meaning, provenance=export.provenance)


def _caption(export: MotionExport) -> str:
    shares = f"{100 * export.speed:g} % of the speed, {100 * export.amplitude:g} % of the amplitude"
    rehearsal = "" if export.speed == export.amplitude == 1 else f"; rehearsal at {shares}"
    return f"Exported motion, {export.seconds:.4g} s{rehearsal}"


KINDS = {
    "csv": f"poses and leg lengths, {RATE} Hz",
    "pi.txt": f"PI wave tables 1 to 6 (X Y Z U V W), {RATE} Hz",
    "moog.bin": f"Moog packets, {MOOG_RATE} Hz",
    "json": "columns, units, rotation order, signs",
}
"""Contents of a file, by the ending of its name."""
FILES = "Each file was read back and compared with the motion; JSON says columns, units, rotation order, signs."
