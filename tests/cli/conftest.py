"""Commands that match the same shapes share what they find."""

from stones import computed_once  # noqa: F401
