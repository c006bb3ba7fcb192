"""``unbend collection evaluate``: how well shapes of a class are found."""

from __future__ import annotations

from typing import Annotated

import typer

from unbend.cli._common import JsonOption, print_json, print_rows, say
from unbend.cli.collection._common import StoreArgument, opened


def evaluate(
    store: StoreArgument,
    labels: Annotated[
        str,
        typer.Option("--labels", metavar="CSV", help="A table with the columns path and label."),
    ],
    as_json: JsonOption = False,
) -> None:
    """Measure how well the descriptors find shapes of the same class.

    Every labelled shape is a query. The measures are those of the Princeton Shape Benchmark, and
    mean average precision. 100 % is best, except for the E-measure of small classes. Shapes
    without a label are ignored, and so are identical files with different labels.

    \b
    Examples:
      unbend collection evaluate shapes --labels labels.csv
      unbend collection evaluate shapes --labels labels.csv --json
    """  # noqa: D301
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
    if as_json:
        counts = {"n_shapes": len(kept), "n_classes": len(set(classes))}
        print_json({"store": store, **measured.to_dict(), **counts})
        return
    print_rows(
        {
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
    )
