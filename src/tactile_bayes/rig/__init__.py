"""The description of a rig: what its data sheets state, how far it may be from them, and the records that it writes."""

from tactile_bayes.rig.file_format import FileFormat
from tactile_bayes.rig.growing import GrowingRecord, Growth
from tactile_bayes.rig.reading import make_record, read_record
from tactile_bayes.rig.rig import Rig
from tactile_bayes.rig.unknown import NOTHING

__all__ = ["NOTHING", "FileFormat", "GrowingRecord", "Growth", "Rig", "make_record", "read_record"]
