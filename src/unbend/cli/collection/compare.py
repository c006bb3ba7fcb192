"""Commands that compare the shapes of a collection: search, matrix, groups, evaluate."""

from __future__ import annotations

import itertools
from typing import Annotated, Any

import typer

import unbend
from unbend.choices import Axis
from unbend.cli import _options as options
from unbend.cli import _output as output
from unbend.cli._input import opened, read_shown
from unbend.cli._output import command_line, progress, say, shown_shape, tell

_MOST_PRINTED = 24


def search(
    store: str,
    query: str,
    n: Annotated[int, options.count("--n-shapes")] = 10,
    by_match: Annotated[bool, typer.Option("--by-match")] = False,
    index: Annotated[bool, typer.Option("--index")] = False,
    report: options.Report = None,
    up: Axis = "y",
) -> None:
    """Find the most similar shapes, whatever their poses. The query need not be in the collection.

      query: The query: a mesh.
      n: Number of results.
      by_match: Rank twice as many again by the energies of their point maps (seconds each).
      index: Use an index, which is created or updated first. It is faster beyond 100,000 shapes.

    $ unbend collection search shapes dog.ply
    $ unbend collection search shapes dog.ply -n 5 --by-match --json
    $ unbend collection search shapes dog.ply --index
    $ unbend collection search shapes dog.ply -n 20 --report found.html
    """
    collection = opened(store, report)
    if report is not None:
        unbend.report.check_count(min(n, len(collection)) + 1)
    hits = collection.search(query, n, by_match=by_match, index=index, progress=progress)
    if report is not None:
        ranked = [hit.distance if hit.energy is None else hit.energy for hit in hits]
        looks: Any = {"up": up, "command": command_line(), "progress": progress}
        looks["measure"] = "energy of the match" if by_match else "distance"
        unbend.report.search_page(query, read_shown(hits, store), ranked, report, **looks)
    ranks = [{"rank": i + 1, **vars(hit)} for i, hit in enumerate(hits)]
    cells = [["rank", "distance", "energy" if by_match else "", "id", "path"]]
    for i, hit in enumerate(hits):
        energy = "" if hit.energy is None else f"{hit.energy:.4f}".replace("inf", "none")
        known = hit.id[: output.SHORT_ID], shown_shape(hit)
        cells.append([str(i + 1), f"{hit.distance:.4f}", energy, *known])
    result = {"store": store, "query": query, "by_match": by_match, "hits": ranks}
    tell(result, output.table(">>><<", *cells), report=report)


def matrix(
    store: str,
    csv: options.Csv = None,
    figure: options.Figure = None,
    report: options.Report = None,
    up: Axis = "y",
) -> None:
    """Compare every shape with every other: distances of the descriptors, 0 for the same shape.

      figure: Draw a heat map with its dendrogram (.png, .pdf, .svg).

    $ unbend collection matrix shapes
    $ unbend collection matrix shapes --csv distances.csv --figure distances.png
    $ unbend collection matrix shapes --report distances.html
    """
    collection = opened(store, csv, figure, report)
    if report is not None:
        unbend.report.check_count(len(collection))
    entries, distances = collection.distances()
    paths = [entry.path for entry in entries]
    # What may be refused comes first, so that no table is left of a command that failed.
    if report is not None:
        looks: Any = {"measure": "distance", "up": up, "command": command_line()}
        unbend.report.similarity_page(read_shown(entries, store), distances, report, **looks)
    if figure is not None:
        unbend.report.draw_distances(unbend.collection.short_names(paths), distances, figure)
    if csv is not None:
        rows = ([path, *row.tolist()] for path, row in zip(paths, distances, strict=True))
        unbend.io.write_table(csv, itertools.chain([["path", *paths]], rows))
    if len(entries) <= _MOST_PRINTED:
        lines = output.matrix([shown_shape(entry) for entry in entries], distances)
    else:
        hint = "" if csv or figure or report else ": add --csv OUT or --figure PNG"
        lines = [f"compared {len(entries):,} shapes, too many to print{hint}"]
    also = [entry.also for entry in entries]
    result = {"store": store, "paths": paths, "also": also, "distances": distances}
    tell(result, lines, written=[csv, figure], report=report)


def groups(
    store: str,
    n: Annotated[int | None, options.count("--n-groups")] = None,
    csv: options.Csv = None,
    report: options.Report = None,
    up: Axis = "y",
) -> None:
    """Group similar shapes, whatever their poses, without labels.

    The groups are those of Ward's linkage of the descriptors. By default their number has the
    largest mean silhouette, of ranks.

      n: Number of groups, by default the best of 2 to 50.

    $ unbend collection groups shapes
    $ unbend collection groups shapes -n 5 --csv groups.csv
    $ unbend collection groups shapes --report groups.html
    """
    collection = opened(store, csv, report)
    if report is not None:
        unbend.report.check_count(len(collection))
    entries, distances = collection.distances()
    numbers = unbend.collection.find_groups(distances, n).tolist()
    members: list[list[unbend.collection.Entry]] = [[] for _ in range(max(numbers) + 1)]
    for entry, number in zip(entries, numbers, strict=True):
        members[number].append(entry)
    paths = [[path for one in some for path in (one.path, *one.also)] for some in members]
    if report is not None:  # it may be refused: before the table
        looks: Any = {"measure": "distance", "up": up, "command": command_line()}
        looks["groups"] = numbers
        unbend.report.similarity_page(read_shown(entries, store), distances, report, **looks)
    if csv is not None:
        pairs = sorted((path, number) for number, some in enumerate(paths) for path in some)
        unbend.io.write_table(csv, [("path", "group"), *pairs])
    lines = []
    for number, some in enumerate(members):
        lines += [f"group {number}: {len(some):,}", *(f"  {shown_shape(one)}" for one in some)]
    guess = None
    if n is None and len(entries) > 2:  # fewer make one group by default, and nothing is chosen
        guess = f"-n N for another number of groups; {len(members)} stand out most"
    tell({"store": store, "groups": paths}, lines, written=[csv], report=report, next_step=guess)


def evaluate(store: str, labels: str) -> None:
    """Measure how well the descriptors find shapes of the same class.

    Every labelled shape is a query. The measures are those of the Princeton Shape Benchmark, and
    mean average precision. 100 % is best, except for the E-measure of small classes. Shapes
    without a label are ignored, and so are identical files with different labels.

      labels: A .csv table with the columns path and label.

    $ unbend collection evaluate shapes labels.csv
    $ unbend collection evaluate shapes labels.csv --json
    """
    entries, distances = opened(store).distances()
    found = unbend.collection.read_labels(labels, [(entry.path, *entry.also) for entry in entries])
    classes = [label for label in found if label is not None]
    if left_out := len(entries) - len(classes):
        say("note", f"{left_out:,} of {len(entries):,} shapes have no label that counts")
    if len(set(classes)) == 1:
        say(
            "warning",
            "all labelled shapes are of one class, so that every result is right, whatever the "
            "descriptors",
        )
    measured = unbend.collection.retrieval_measures(distances, found)
    names = ("nearest_neighbor", "first_tier", "second_tier", "e_measure", "dcg", "map")
    heads = ("nearest neighbour", "first tier", "second tier", "E-measure", "DCG", "mAP")
    values = [f"{getattr(measured, name):.1%}" for name in names]
    lines = dict(zip(heads, values, strict=True))
    curve = [f"{measured.precision[i]:.0%} at {measured.recall[i]:.0%}" for i in (4, 9, 14, 19)]
    lines["precision"] = f"{' recall, '.join(curve)} recall"
    lines |= {"shapes": f"{len(classes):,}", "classes": f"{len(set(classes)):,}"}
    counts = {"n_shapes": len(classes), "n_classes": len(set(classes))}
    tell({"store": store, **measured.to_dict(), **counts}, output.rows(lines))
