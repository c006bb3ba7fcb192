"""``unbend cache``: the spectra kept on disk."""

from __future__ import annotations

from unbend.cli._command import make_group
from unbend.cli._output import rows, tell


def info() -> None:
    """Show where the cache is and what it holds.

    Examples
    --------
      unbend cache info
      unbend cache info --json
    """
    from unbend.spectral import cache_info

    found = cache_info()
    lines = {
        "folder": str(found.folder),
        "spectra": f"{found.n_files:,}",
        "size": f"{found.n_bytes / 2**20:,.1f} of {found.most_bytes / 2**20:,.0f} MiB",
    }
    tell(vars(found) | {"folder": lines["folder"]}, rows(lines))


def clear() -> None:
    """Remove every cached spectrum.

    Examples
    --------
      unbend cache clear
    """
    from unbend.spectral import clear_cache

    removed = clear_cache()
    tell({"n_removed": removed}, [f"removed {removed:,} spectra"])


app = make_group("Show or empty the cache of spectra.", info, clear)
