"""A window in the browser, on this machine alone, for people who would rather look than type."""

from unbend.app._server import serve

__all__ = ["serve"]
