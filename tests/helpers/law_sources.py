"""Tables of sources, one of each kind of error that the law propagates, and a correlation of two."""

from tests.helpers.source_lab import source

SOURCES = [
    source("F_noise", "F", "precision", sigma=["0.3 N"] * 3),
    source("M_noise", "M", "precision", sigma=["0.02 N*m"] * 3, correlation=[[1, 0.6, 0], [0.6, 1, 0], [0, 0, 1]]),
    source("M_rounding", "M", "quantisation", step=["0.001 N*m"] * 3),
    source("gyro_noise", "omega", "precision", sigma=["2e-3 rad/s", "3e-3 rad/s", "1e-3 rad/s"]),
    source("F_offset", "F", "bias", distribution="rectangular", half_width=["1 N"] * 3),
    source("F_scale", "F", "scale", sigma=["0.3 %"] * 3),
    source("M_scale", "M", "scale", sigma=["0.3 %"] * 3),
    source("cross_talk", "wrench", "cross_talk", datasheet="±0.5 % FS", full_scale=["300 N"] * 3 + ["20 N*m"] * 3),
    source("cell_turn", "wrench", "misalignment", sigma=["0.2 deg"] * 3),
    source("M_drift", "M", "drift", sigma=["0.5 N*m/min"] * 3),
    source("gyro_offset", "omega", "bias", sigma=["5e-3 rad/s"] * 3),
    source("gyro_scale", "omega", "scale", sigma=["0.3 %"] * 3),
    source("gyro_turn", "omega", "misalignment", distribution="triangular", half_width=["0.5 deg"] * 3),
    source("gyro_drift", "omega", "drift", sigma=["1 deg/s/min"] * 3),
    source("delay", "omega", "delay", mean="1 ms", sigma="0.5 ms"),
    source("gravity", "gravity", "bias", sigma="0.01 m/s^2"),
    source("cg_height", "r_cg_from_omb", "bias", sigma=["1 mm"] * 3),
    source("tilt", "tilt", "bias", sigma=["0.1 deg"] * 3),
    source("buoyancy", "displaced_air", "bias", mean="3 g", sigma="0.5 g", centre_from_cg=["0 mm", "0 mm", "-5 mm"]),
    source("air", "entrained_air", "bias", mean="4 g", sigma="1 g", centre_from_cg=["0 mm", "0 mm", "-5 mm"],
           radii_of_gyration=["150 mm", "40 mm", "150 mm"]),
]  # fmt: skip
LINKED = [{"sources": ["F_scale", "M_scale"], "coefficient": 0.9}]
