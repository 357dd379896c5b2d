"""Figures 2 to 11 of Merker et al. 2018 (doi 10.1155/2018/1613945), each computed anew.

`figure` makes one, `draw_all` writes them to files. They take the look of `plotting.style`, which `draw_all` applies.
"""

from tactile_bayes.paper_figures.catalogue import NUMBERS, caption, figure
from tactile_bayes.paper_figures.files import draw_all

__all__ = ["NUMBERS", "caption", "draw_all", "figure"]
