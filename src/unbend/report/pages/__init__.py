"""Interactive pages: one HTML file each, which opens in any browser without a network."""

from unbend.report.pages._document import Page
from unbend.report.pages._form_page import form_page
from unbend.report.pages._match_page import match_page
from unbend.report.pages._shapes import check_count
from unbend.report.pages._similarity_page import search_page, similarity_page
from unbend.report.pages._view_page import view

__all__ = [
    "Page",
    "check_count",
    "form_page",
    "match_page",
    "search_page",
    "similarity_page",
    "view",
]
