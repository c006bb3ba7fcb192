"""What is computed once for all tests that ask for it."""

import functools
from collections.abc import Callable
from typing import Any

from unbend import Mesh
from unbend.errors import MeshError, heard, warn


def once(function: Callable[..., Any]) -> Callable[..., Any]:
    """Call a function of the same shapes with the same options once, unless it warns.

    Errors are kept, too.
    """
    known: dict[Any, Any] = {}

    @functools.wraps(function)
    def call(*shapes: Mesh, **options: Any) -> Any:
        arrays = [one.tobytes() for shape in shapes for one in (shape.vertices, shape.faces)]
        key = *arrays, repr({name: one for name, one in options.items() if name != "progress"})
        if key not in known:
            try:
                with heard() as said:
                    found = function(*shapes, **options)
                for message in said:
                    warn(message)
                if said:
                    return found
                known[key] = found
            except MeshError as error:
                known[key] = error
        if isinstance(known[key], MeshError):
            raise known[key]
        return known[key]

    return call
