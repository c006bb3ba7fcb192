"""``unbend cache``: the spectra kept on disk."""

from __future__ import annotations

import typer

from unbend.cli._common import JsonOption, print_json, print_rows

app = typer.Typer(
    help="Show or empty the cache of spectra.", no_args_is_help=True, rich_markup_mode=None
)


@app.command()
def info(as_json: JsonOption = False) -> None:
    """Show where the cache is and what it holds."""
    from unbend.spectral import cache_info

    found = cache_info()
    if as_json:
        print_json(
            {
                "folder": str(found.folder),
                "spectra": found.n_files,
                "bytes": found.n_bytes,
                "most_bytes": found.most_bytes,
            }
        )
        return
    print_rows(
        {
            "folder": str(found.folder),
            "spectra": f"{found.n_files:,}",
            "size": f"{found.n_bytes / 2**20:,.1f} of {found.most_bytes / 2**20:,.0f} MiB",
        }
    )


@app.command()
def clear() -> None:
    """Remove every cached spectrum."""
    from unbend.spectral import clear_cache

    typer.echo(f"removed {clear_cache():,} spectra")
