"""Contact phases: codes and names."""

# Codes of the contact phase: no contact, Phase A (the tip touches), Phase B (the rod touches tangentially).
NONE, TIP, TANGENTIAL = 0, 1, 2
PHASE_NAMES = ("none", "tip", "tangential")  # names of the contact phases, by code
