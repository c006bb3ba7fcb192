"""Options that do not go together."""

from __future__ import annotations

from typing import Any

from unbend.errors import InputError


def refuse_given(reason: str, **options: Any) -> None:
    """Refuse options that were given, though they cannot be used.

    Parameters
    ----------
    reason : str
        What follows the option's name in the message.
    **options
        None: it was not given.

    Raises
    ------
    InputError
        For the first that was.

    Examples
    --------
    >>> from unbend._options import refuse_given
    >>> refuse_given("is for sampled forms", mu=None, n_samples=200)
    Traceback (most recent call last):
    unbend.errors.InputError: n_samples is for sampled forms
    """
    for name, value in options.items():
        if value is not None:
            raise InputError(f"{name} {reason}")
