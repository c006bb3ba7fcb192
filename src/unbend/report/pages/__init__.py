"""Interactive pages: one HTML file each, which opens in any browser without a network."""

from unbend.report.pages._form_page import form_page
from unbend.report.pages._match_page import match_page

__all__ = ["form_page", "match_page"]
