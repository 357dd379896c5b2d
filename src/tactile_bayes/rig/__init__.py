"""The description of a rig: what its data sheets state, how far it may be from them, and how its files are written."""

from tactile_bayes.rig.rig import NOTHING, Rig

__all__ = ["NOTHING", "Rig"]
