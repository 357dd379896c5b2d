"""The files that each command can write into its folder; without the first of them the folder is not complete."""

from __future__ import annotations

PICTURES = ("predictive", "rods", "contour", "gap", "trace", "pairs")
INFERENCE = (
    *("summary.txt", "posterior.nc", "contacts.csv", "band.csv", "summary.csv"),
    *(f"{name}.png" for name in PICTURES),
)
TRUST = ("trust.nc", "trust.txt", "assumptions.png")
OVERLAY = "overlay.png"
# Files of other commands that belong to the posterior of a folder.
OF_POSTERIOR = ("report.html", OVERLAY, *TRUST, "trust/replicates.json", "trust/alternatives.json")
WATCH_PAGE = "watch.html"
WATCH = ("stream.nc", WATCH_PAGE)
INSPECTION = ("inspection.txt", "sweeps.csv", "channels.csv", "samples.csv", "inspection.png", "rig.toml")
RECONSTRUCTION = ("contacts.csv", "contacts.png")
COMPARISON = ("comparison.nc", "comparison.csv", "families.png")
MANY = ("runs.csv", "runs.nc")
RIG = ("summary.txt", "rig.toml", "rig.nc", "summary.csv")
CALIBRATION = ("verdict.txt", "calibration.nc", "ranks.png", "coverage.png")
DESIGN = ("words.txt", "design.nc", "candidates.csv", "design.png")
STUDY = ("study.nc", "study.png")
SENSITIVITY = (
    *("words.txt", "sensitivity.nc", "amplification.png", "information.png", "noise_shares.png", "required_noise.png"),
    *("rods.nc", "required_rod.png", *(f"study/{name}" for name in STUDY)),
)
CHECKPOINT = ("checkpoint.npz",)
DATASET = ("manifest.json", "README.md", "shard-*.nc")
FIGURES = ("figure_*.pdf", "figure_*.svg", "figure_*.png")
