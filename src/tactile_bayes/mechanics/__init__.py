"""The forward model: the rod's closed form, contact states, paths, events and loads at drive angles, each once.

`arc` (a piece of elastica) → `chord` (the piece that joins given ends) → `tables` and `states` (contact ↔ what the base
feels) → `outline`, `reach`, `stretches`, `path` (one rod along one contour, from first contact to snap-off) → `sweeps`
(many of them). All of this is scalar code that numba compiles, for any strictly convex contour, with friction and
compliance, in both directions; exact, or as well as noise asks, by `stretches.Accuracy`. `elastica` and `paths` are its
faces for arrays, which load numba when they are called.

Another rod enters where `states` asks `chord` and `tables`, as another map from how its ends lie to force and turn;
another drive enters where `path` compares states with drive angles, which is the only place that knows that the base
turns about a pivot.
"""

from tactile_bayes.mechanics import elastica as elastica
