"""The command line: ``python -m unbend``, and the ``unbend`` script."""

from __future__ import annotations


def main() -> None:
    """Run it; Ctrl-C ends it quietly even while it is still imported."""
    try:
        from unbend.cli import main as run

        run()
    except KeyboardInterrupt:
        raise SystemExit(130) from None  # what shells report after Ctrl-C


if __name__ == "__main__":
    main()
