"""The command `rig`: what a file says, and what may be unknown."""

from helpers.commands import answered, call
from tactile_bayes.rig.parameters import PARAMETERS, STANDARD, members

SHEET = """
[rod]
length = "200 mm"
flexural_rigidity = 0.0024
taper = 0.2

[load_cell]
force_noise = "3 mN"

[file]
split_sweeps = true
force_x = "-1e-3*Fx[N]"

[unknown]
lever = 0.0
friction = { half_normal = 0.2 }
taper = "default"
"""


def test_every_parameter_is_listed_with_its_row():
    answer = answered("rig", "--parameters")
    rows = {row["name"]: row for row in answer["parameters"]}
    assert list(rows) == list(PARAMETERS)
    for name, row in rows.items():
        assert (row["meaning"], row["unit"]) == (PARAMETERS[name].meaning, PARAMETERS[name].unit)
        assert row["default"].startswith(PARAMETERS[name].default.replace("_", "-"))
    assert rows["force_x_bias"]["default"] == "normal, 0.1 EI/L²"
    assert rows["backlash"]["default"] == "normal, 0.2°"
    said = call("rig", "--parameters").stdout
    assert all(name in said for name in PARAMETERS)
    assert f"rig.toml says otherwise: {', '.join(STANDARD)}" in said


def test_a_file_is_said_in_words(rig_file):
    path = rig_file(SHEET)
    said = answered("rig", path)
    assert said["known"] == {"lever_x": 0.0, "lever_y": 0.0}
    assert said["said"]["lever_x"] == "known, 0"
    assert said["said"]["taper"] == "unknown, by default"
    assert "0.2" in said["said"]["friction"]
    assert {member for name in STANDARD for member in members(name)} <= set(said["said"])
    words = call("rig", path).stdout
    for part in ("L = 0.2 m, EI = 0.0024 N m²", "force_noise = 0.003", "force_x = -1e-3*Fx[N]", "turns of the drive"):
        assert part in words
