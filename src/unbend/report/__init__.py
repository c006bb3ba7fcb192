"""Pictures and pages of results."""

from unbend.report._plot import plot
from unbend.report.collection_figures import draw_distances, draw_similarities
from unbend.report.colors import position_colors
from unbend.report.figures import (
    draw_canonical_forms,
    draw_mesh,
    new_figure,
    same_scale,
    save_figure,
)
from unbend.report.match_figures import draw_error_curves, draw_match, match_colors, pattern_colors
from unbend.report.pages._document import Page
from unbend.report.pages._form_page import form_page
from unbend.report.pages._match_page import match_page
from unbend.report.pages._similarity_page import check_count as check_count
from unbend.report.pages._similarity_page import search_page, similarity_page
from unbend.report.pages._view_page import view
from unbend.report.shape_figures import draw_form, draw_values, draw_variation

__all__ = [
    "Page",
    "draw_canonical_forms",
    "draw_distances",
    "draw_error_curves",
    "draw_form",
    "draw_match",
    "draw_mesh",
    "draw_similarities",
    "draw_values",
    "draw_variation",
    "form_page",
    "match_colors",
    "match_page",
    "new_figure",
    "pattern_colors",
    "plot",
    "position_colors",
    "same_scale",
    "save_figure",
    "search_page",
    "similarity_page",
    "view",
]
