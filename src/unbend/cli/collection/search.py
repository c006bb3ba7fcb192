"""``unbend collection search``: the shapes most like one, whatever the pose."""

from __future__ import annotations

import math
import time
from typing import Annotated

import typer

from unbend.choices import Rerank
from unbend.cli._common import JsonOption, UpOption, command_line, print_json
from unbend.cli.collection._common import (
    SHORT_ID,
    ReportOption,
    StoreArgument,
    bar_on_stderr,
    opened,
    read_found,
    shown_shape,
)

_MEASURES = {"none": "distance", "form": "distance of forms", "match": "energy of the match"}


def search(
    store: StoreArgument,
    query: Annotated[str, typer.Argument(metavar="QUERY", help="The query: a mesh.")],
    n: Annotated[int, typer.Option("-n", metavar="N", min=1, help="Number of results.")] = 10,
    rerank: Annotated[
        Rerank,
        typer.Option(
            "--rerank",
            help="Order the best again: form, by aligned canonical forms (hundredths of a second "
            "each), or match, by point maps (seconds each).",
        ),
    ] = "none",
    index: Annotated[
        bool,
        typer.Option(
            "--index",
            help="Use an index, which is created or updated first. It is faster beyond 100,000 "
            "shapes.",
        ),
    ] = False,
    report: ReportOption = None,
    up: UpOption = "y",
    as_json: JsonOption = False,
) -> None:
    """Find the most similar shapes, whatever their poses. The query need not be in the collection.

    \b
    Examples:
      unbend collection search shapes dog.ply
      unbend collection search shapes dog.ply -n 5 --rerank form --json
      unbend collection search shapes dog.ply --index
      unbend collection search shapes dog.ply -n 20 --report found.html
    """  # noqa: D301
    from unbend.io import check_writable

    if report is not None:
        check_writable(report, (".html",))
    collection = opened(store, report)
    start = time.perf_counter()
    with bar_on_stderr() as progress:
        hits = collection.search(query, n, rerank=rerank, index=index, progress=progress)
        seconds = time.perf_counter() - start
        if report is not None:
            from unbend.report.pages import search_page

            ranked = [hit.distance if hit.reranked is None else hit.reranked for hit in hits]
            search_page(
                query,
                read_found(hits, store),
                ranked,
                report,
                measure=_MEASURES[rerank],
                up=up,
                command=command_line(),
                progress=progress,
            )
    if as_json:
        print_json(
            {
                "store": store,
                "query": query,
                "rerank": rerank,
                "hits": [{"rank": i + 1, **vars(hit)} for i, hit in enumerate(hits)],
                "seconds": seconds,
                "report": report,
            }
        )
        return
    again = "" if rerank == "none" else f"  {rerank:>8}"
    typer.echo(f"{'rank':>4}  {'distance':>8}{again}  {'id':<{SHORT_ID}}  path")
    for i, hit in enumerate(hits):
        again = "" if hit.reranked is None else f"  {_number(hit.reranked)}"
        typer.echo(
            f"{i + 1:>4}  {hit.distance:8.4f}{again}  {hit.id[:SHORT_ID]}  {shown_shape(hit)}"
        )
    if report is not None:
        typer.echo(f"next: open {report} in a browser")


def _number(value: float) -> str:
    return f"{value:8.4f}" if math.isfinite(value) else f"{'none':>8}"
