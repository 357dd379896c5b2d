"""Figures 2 to 11 of Merker et al. 2018 (doi 10.1155/2018/1613945), each computed anew.

`figure` makes a figure, `draw_all` writes figures to files in a look of `plotting.style`.
"""

from tactile_bayes.paper_figures.catalogue import NUMBERS, caption, figure
from tactile_bayes.paper_figures.files import draw_all

__all__ = ["NUMBERS", "caption", "draw_all", "figure"]
