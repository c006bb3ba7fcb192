"""Interactive pages: one HTML file each, which opens in any browser without a network."""

from unbend.report.pages._match_page import match_page

__all__ = ["match_page"]
