"""Specifications of small data sets."""

import copy
import hashlib
import tomllib

from tactile_bayes.rig import NOTHING

# One family, dimensionless.
PLAIN = tomllib.loads("""
name = "parabolas"
records = 24
shard_records = 8
seed = 7
[[contours]]
family = "parabola"
a = { log_uniform = [0.3, 3.0] }
q = { uniform = [0.3, 0.7] }
x_c = { normal = [0, 0.05] }
[scan]
samples = 24
[load_cell]
moment_noise = { log_normal = [0.02, 0.3] }
force_noise = 0.05
""")
# Most of what a specification can say, in SI.
RICH = tomllib.loads("""
name = "many things"
description = "Two families, steel wires, two bases."
records = 20
shard_records = 7
seed = 11
precision = "single"
[[contours]]
family = "circle"
weight = 2
r = { uniform = [0.03, 0.1] }
q = { uniform = [0.03, 0.09] }
[[contours]]
family = "parabola/ellipse"
left_a = { uniform = [5.0, 20.0] }
right_a = { uniform = [0.04, 0.1] }
right_b = { choice = [0.03, 0.05] }
q = { uniform = [0.03, 0.07] }
[rod]
length = { uniform = [0.08, 0.12] }
flexural_rigidity = { log_normal = [1e-4, 0.2] }
diameter = { choice = [3e-4, 5e-4] }
[scan]
bases = [[0.0, 0.0], [{ uniform = [-0.02, 0.02] }, { normal = [-0.005, 0.001] }]]
samples = 20
margin = 0.2
[load_cell]
frame = "turning"
moment_noise = 1e-5
force_noise = { log_uniform = [1e-4, 1e-3] }
bias_force_x = { normal = [0.0, 1e-3] }
random_walk_force = 1e-5
drive_angle_noise = 1e-3
drive_angle_offset = { uniform = [-0.01, 0.01] }
""")
RICH["unknown"] = {**NOTHING, "friction": 0.2}


def changed(spec, **changes):
    """A copy with other entries; `scan__samples=5` changes one inside a table, None removes it."""
    new = copy.deepcopy(spec)
    for key, value in changes.items():
        table, *inner = key.split("__")
        place, last = (new.setdefault(table, {}), inner[0]) if inner else (new, table)
        if value is None:
            place.pop(last, None)
        else:
            place[last] = value
    return new


def hashes(folder):
    """SHA-256 of every file of a data set by its name."""
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.iterdir())}


SHAPES = changed(
    PLAIN,
    contours=[{"family": "shape-free", "r": 0.8, "amplitude": 0.1, "length_scale": 1.5, "q": {"uniform": [0.4, 0.5]}}],
)
