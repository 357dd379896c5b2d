"""The forward model: a rod's closed form, contact states, branches of equilibria, events, and loads at drive angles.

`jacobi` → `pose` (pivot as seen from the contact, in closed form, for a uniform rod of constant rest curvature) and
`along` → `profile` → `taylor` (the same for any other rod, by Taylor series: `profile_pose`, `profile_shape`; for
likelihoods by a `forward_table`, whose `sheet` holds one rod) meet in `beam`, the rod as the forward model sees it →
`equilibrium` (rod and contour) → `leg` and `branch` (one rod along one contour, from `first_contact` to snap-off, with
what it meets on its legs, `meeting`, and what rules them out, `refusals`) → `readings` and `sweeps` (loads and states
at drive angles, of many of them). All of this is scalar code that numba compiles, for any strictly convex contour, with
friction and compliance, in both directions. `leg.Accuracy` says whether it is exact or as accurate as noise requires.
`elastica` (single states and Step 2: `wrenches` from contacts, with `continuation` for rods that are not straight, and
`states` back) and `paths` are its interface for arrays; they load numba when they are called. `rod` is what users give,
and `traced` a rod from points along it.

Another drive enters where `branch` compares states with drive angles: no other place knows that the base turns about a
pivot.
"""

from tactile_bayes.mechanics import elastica as elastica
