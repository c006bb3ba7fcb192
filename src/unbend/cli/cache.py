"""``unbend cache``: the spectra kept on disk."""

from __future__ import annotations

import unbend
from unbend.cli._command import make_group
from unbend.cli._output import rows, tell


def info() -> None:
    """Show where the cache is and what it holds.

    $ unbend cache info
    $ unbend cache info --json
    """
    found = unbend.spectral.cache_info()
    lines = {
        "folder": str(found.folder),
        "spectra": f"{found.n_files:,}",
        "size": f"{found.n_bytes / 2**20:,.1f} of {found.most_bytes / 2**20:,.0f} MiB",
    }
    tell(vars(found) | {"folder": lines["folder"]}, rows(lines))


def clear() -> None:
    """Remove every cached spectrum.

    $ unbend cache clear
    """
    removed = unbend.spectral.clear_cache()
    tell({"n_removed": removed}, [f"removed {removed:,} spectra"])


app = make_group("Show or empty the cache of spectra.", info, clear)
