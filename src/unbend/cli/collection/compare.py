"""Commands that compare the shapes of a collection: search, matrix, groups, evaluate."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from unbend.choices import Rerank
from unbend.cli import _options as options
from unbend.cli._output import (
    command_line,
    look_at,
    progress_on_stderr,
    rows,
    say,
    table,
    tell,
    write_table,
)
from unbend.cli._output import matrix as matrix_lines
from unbend.cli.collection._common import (
    SHORT_ID,
    opened,
    read_found,
    shown_shape,
    write_page,
)

if TYPE_CHECKING:
    from unbend.collection import Entry, Hit

_MEASURES = {"none": "distance", "form": "distance of forms", "match": "energy of the match"}
_MOST_PRINTED = 24


def search(
    store: options.Store,
    query: Annotated[str, typer.Argument(metavar="QUERY", help="The mesh to look for.")],
    n: Annotated[
        int, typer.Option("-n", "--n-shapes", metavar="N", min=1, help="How many to find.")
    ] = 10,
    rerank: Annotated[
        Rerank,
        typer.Option(
            "--rerank",
            help="Rank the best again: by how their canonical forms align (hundredths of a second "
            "each), or by match (seconds each).",
        ),
    ] = "none",
    index: Annotated[
        bool,
        typer.Option(
            "--index",
            help="Look at the likely shapes only, by an index that is made or brought up to date "
            "first; worth it beyond 100,000 shapes.",
        ),
    ] = False,
    report: options.Report = None,
    up: options.Up = "y",
) -> None:
    """Find the shapes most like one, whatever the pose; it need not be in the collection.

    Examples
    --------
      unbend collection search shapes dog.ply
      unbend collection search shapes dog.ply -n 5 --rerank form --json
      unbend collection search shapes dog.ply --index
      unbend collection search shapes dog.ply -n 20 --report found.html
    """
    collection = opened(store, report)
    with progress_on_stderr() as progress:
        hits = collection.search(query, n, rerank=rerank, index=index, progress=progress)
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
    tell(
        {
            "store": store,
            "query": query,
            "rerank": rerank,
            "hits": [{"rank": i + 1, **vars(hit)} for i, hit in enumerate(hits)],
        },
        _lines(hits, rerank),
        written=[report],
        next_step=look_at(report),
    )


def _lines(hits: list[Hit], rerank: str) -> list[str]:
    cells = [["rank", "distance", "" if rerank == "none" else rerank, "id", "path"]]
    for i, hit in enumerate(hits):
        again = "" if hit.reranked is None else "none"
        if hit.reranked is not None and math.isfinite(hit.reranked):
            again = f"{hit.reranked:.4f}"
        cells.append(
            [str(i + 1), f"{hit.distance:.4f}", again, hit.id[:SHORT_ID], shown_shape(hit)]
        )
    return table(">>><<", *cells)


def matrix(
    store: options.Store,
    csv: options.Csv = None,
    figure: Annotated[str | None, options.figure("Draw a heat map with its dendrogram")] = None,
    report: options.Report = None,
    up: options.Up = "y",
) -> None:
    """Compare every shape with every other: distances of the descriptors, 0 for the same shape.

    Examples
    --------
      unbend collection matrix shapes
      unbend collection matrix shapes --csv distances.csv --figure distances.png
      unbend collection matrix shapes --report distances.html
    """
    entries, distances = opened(store, csv, figure, report).distances()
    if csv is not None:
        rows = ([entry.path, *row] for entry, row in zip(entries, distances.tolist(), strict=True))
        write_table(csv, [["path", *(entry.path for entry in entries)], *rows])
    if figure is not None:
        from unbend.report.collection_figures import draw_distances

        draw_distances([Path(entry.path).stem for entry in entries], distances, figure)
    if report is not None:
        write_page(report, store, entries, distances, up)
    if len(entries) <= _MOST_PRINTED:
        lines = matrix_lines([shown_shape(entry) for entry in entries], distances)
    else:
        hint = "" if csv or figure or report else ": add --csv OUT or --figure PNG"
        lines = [f"compared {len(entries):,} shapes, too many to print{hint}"]
    tell(
        {
            "store": store,
            "paths": [entry.path for entry in entries],
            "also": [entry.also for entry in entries],
            "distances": distances,
        },
        lines,
        written=[csv, figure, report],
        next_step=look_at(report),
    )


def groups(
    store: options.Store,
    n: Annotated[
        int | None,
        typer.Option(
            "-n",
            "--n-groups",
            metavar="N",
            min=1,
            help="How many groups; by default the number that stands out most, of 2 to 50.",
        ),
    ] = None,
    csv: options.Csv = None,
    report: options.Report = None,
    up: options.Up = "y",
) -> None:
    """Put shapes that are alike into groups, whatever their poses, without labels.

    Average linkage of the descriptors' distances; the number of groups is the one of the largest
    mean silhouette.

    Examples
    --------
      unbend collection groups shapes
      unbend collection groups shapes -n 5 --csv groups.csv
      unbend collection groups shapes --report groups.html
    """
    from unbend.collection import find_groups

    entries, distances = opened(store, csv, report).distances()
    numbers = find_groups(distances, n).tolist()
    members: list[list[Entry]] = [[] for _ in range(max(numbers) + 1)]
    for entry, number in zip(entries, numbers, strict=True):
        members[number].append(entry)
    paths = [[path for one in some for path in (one.path, *one.also)] for some in members]
    if csv is not None:
        pairs = sorted((path, number) for number, some in enumerate(paths) for path in some)
        write_table(csv, [("path", "group"), *pairs])
    if report is not None:
        write_page(report, store, entries, distances, up, groups=numbers)
    lines = []
    for number, some in enumerate(members):
        lines += [f"group {number}: {len(some):,}", *(f"  {shown_shape(one)}" for one in some)]
    tell({"store": store, "groups": paths}, lines, written=[csv, report], next_step=look_at(report))


def evaluate(
    store: options.Store,
    labels: Annotated[
        str,
        typer.Argument(metavar="LABELS", help="A .csv table with the columns path and label."),
    ],
) -> None:
    """Measure how well the descriptors find shapes of a class: every shape asks for its own kind.

    The measures are those of the Princeton Shape Benchmark, and mean average precision; 100 % is
    best, but for the E-measure where classes are small. Shapes without a label do not count, nor
    do shapes whose files are identical but have different labels.

    Examples
    --------
      unbend collection evaluate shapes labels.csv
      unbend collection evaluate shapes labels.csv --json
    """
    import numpy as np

    from unbend.collection import read_labels, retrieval_measures

    entries, distances = opened(store).distances()
    found = read_labels(labels, [(entry.path, *entry.also) for entry in entries])
    kept = np.array([i for i, label in enumerate(found) if label is not None], dtype=int)
    classes = [label for label in found if label is not None]
    if len(kept) < len(entries):
        left_out = len(entries) - len(kept)
        say("note", f"{left_out:,} of {len(entries):,} shapes have no label that counts")
    measured = retrieval_measures(distances[np.ix_(kept, kept)], classes)
    lines = {
        "nearest neighbour": f"{measured.nearest_neighbor:.1%}",
        "first tier": f"{measured.first_tier:.1%}",
        "second tier": f"{measured.second_tier:.1%}",
        "E-measure": f"{measured.e_measure:.1%}",
        "DCG": f"{measured.dcg:.1%}",
        "mAP": f"{measured.map:.1%}",
        "precision": ", ".join(
            f"{measured.precision[i]:.0%} at {measured.recall[i]:.0%} recall"
            for i in (4, 9, 14, 19)
        ),
        "shapes": f"{len(kept):,} of {len(set(classes)):,} classes",
    }
    counts = {"n_shapes": len(kept), "n_classes": len(set(classes))}
    tell({"store": store, **measured.to_dict(), **counts}, rows(lines))
