"""The forward model: the rod's closed form, contact states, paths, events, and loads at drive angles.

`arc` (a piece of elastica) → `chord` (the piece that joins given ends) → `tables` and `states` (contact ↔ base wrench)
→ `outline`, `limits`, `stretches`, `continuation` (one rod along one contour, from first contact to snap-off) →
`sweeps` (many of them). All of this is scalar code that numba compiles, for any strictly convex contour, with friction
and compliance, in both directions. `stretches.Accuracy` decides whether it is exact or as accurate as noise requires.
`elastica` and `paths` are its interface for arrays; they load numba when they are called.

Another rod enters where `states` calls `chord` and `tables`, as another map from the position of its ends to force and
turn. Another drive enters where `continuation` compares states with drive angles: no other place knows that the base
turns about a pivot.
"""

from tactile_bayes.mechanics import elastica as elastica
