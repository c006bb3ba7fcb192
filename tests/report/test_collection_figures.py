"""Heat maps have their names in the order of the dendrogram, which is that of Ward's linkage."""

from pathlib import Path

import numpy as np
import pytest

from unbend.errors import InputError
from unbend.report import collection_figures, draw_distances, draw_similarities
from unbend.report.collection_figures import join_alike


class Column(list):
    """As of pandas, sorted: a row is not found by its place."""

    def __getitem__(self, index: object) -> str:
        raise KeyError(index)


@pytest.mark.parametrize("n", [5, 25])
def test_the_alike_stand_together(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list = []
    monkeypatch.setattr(collection_figures, "save_figure", lambda one, path: drawn.append(one))
    kinds = np.arange(n) % 2
    table = np.where(kinds[:, None] == kinds, 0.9, 0.3)
    np.fill_diagonal(table, 1)
    table[0, 1] = table[1, 0] = np.nan
    draw_similarities(Column(f"{kind}" for kind in kinds), table, "any.png")
    draw_distances([f"{kind}" for kind in kinds], np.nan_to_num(1 - table, nan=1), "any.png")
    groups = ["0" * (kinds == 0).sum(), "1" * (kinds == 1).sum()]
    for figure in drawn:
        axes = figure.get_axes()[1]
        names = "".join(one.get_text() for one in axes.get_yticklabels())
        assert names in ("".join(groups), "".join(groups[::-1]))
        assert len(axes.texts) in ((n**2 - 2, n**2) if n < 20 else (0,))


def test_a_file_is_written(tmp_path: Path) -> None:
    draw_similarities(["a", "b"], [[1, 0.5], [0.5, 1]], tmp_path / "heat.png")
    assert (tmp_path / "heat.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("draw", [draw_distances, draw_similarities])
def test_what_does_not_fit_is_refused(draw) -> None:
    with pytest.raises(InputError, match="2 shapes need values of shape"):
        draw(["a", "b"], [[1]], "a.png")
    with pytest.raises(InputError, match="two or more, not 1"):
        draw(["a"], [[1]], "a.png")


def test_joins_are_as_high_as_they_spread_their_branches() -> None:
    """Half the square is what a join adds to the squared distances from the branch's centroid."""
    points = np.random.default_rng(3).random((9, 2))
    distances = np.linalg.norm(points[:, None] - points, axis=2)
    order, heights, places = join_alike(distances, alike=False)
    assert sorted(order) == list(range(9))
    # A bracket's ends are at the middles of its branches, which are leaves or brackets before it.
    members = {float(i): {int(order[i])} for i in range(9)}
    rows = sorted(zip(heights, places, strict=True), key=lambda row: row[0][1])
    for height, ends in rows:
        first, second = members.pop(ends[0]), members.pop(ends[3])
        both = first | second
        added = [((points[list(one)] - points[list(one)].mean(axis=0)) ** 2).sum()
                 for one in (both, first, second)]  # fmt: skip
        spread = np.sqrt(2 * (added[0] - added[1] - added[2]))
        assert height[1] == height[2] == pytest.approx(spread)
        members[(ends[0] + ends[3]) / 2] = both
    assert len(members) == 1


def test_what_is_unknown_is_far_apart() -> None:
    table = np.array([[1.0, 0.9, np.nan], [0.9, 1.0, 0.2], [np.nan, 0.2, 1.0]])
    for values in (table, 1 - table):
        _, heights, _ = join_alike(values, alike=values is table)
        last = np.sqrt((2 * (1 + 0.8**2) - 0.1**2) / 3)
        assert sorted(heights[:, 1]) == pytest.approx([0.1, last])
