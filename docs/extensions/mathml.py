"""Equations as MathML, made when the site is built: pages need neither scripts nor fonts nor a network to show them."""

from __future__ import annotations

import re
from html import escape
from typing import TYPE_CHECKING, Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.util.math import get_node_equation_number, wrap_displaymath

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.writers.html5 import HTML5Translator

_FUNCTION = r"<mi>(?:arcsin|arctan|atan2|cos|cot|log|sin|tan)</mi>"
_BEFORE = re.compile(rf"(</m(?:i|n|sub|sup|sqrt|frac)>)(?=(?:<msup>)?{_FUNCTION})")
_AFTER = re.compile(rf"({_FUNCTION}|<msup>{_FUNCTION}<mn>\d</mn></msup>)(?=<m(?:i|n|sub|sup|sqrt|frac))")
_SPACE = r'\1<mspace width="0.17em" />'
"""Around the names of functions, where nothing else separates them."""


def inline(translator: HTML5Translator, node: nodes.math) -> None:
    """An equation in a line of text."""
    translator.body.append(_mathml(node.astext(), display="inline"))
    raise nodes.SkipNode


def block(translator: HTML5Translator, node: nodes.math_block) -> None:
    """An equation that stands by itself, with its number if it has a label."""
    latex = wrap_displaymath(node.astext(), None, False) if "&" in node.astext() else node.astext()
    number = ""
    if node["number"]:
        number = f'<span class="eqno">({get_node_equation_number(translator, node)})</span>'
    begin = translator.starttag(node, "div", CLASS="math")
    translator.body.append(f"{begin}{number}{_mathml(latex, display='block')}</div>\n")
    raise nodes.SkipNode


def _mathml(latex: str, display: str) -> str:
    """MathML that says in an attribute which LaTeX it was made from, for those who copy it or hear it."""
    made = _AFTER.sub(_SPACE, _BEFORE.sub(_SPACE, convert(latex, display=display)))
    return made.replace("<math ", f'<math aria-label="{escape(latex.strip(), quote=True)}" ', 1)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.add_html_math_renderer("mathml", inline_renderers=(inline, None), block_renderers=(block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
