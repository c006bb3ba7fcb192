"""Heat maps have their names in the order of the dendrogram."""

from pathlib import Path

import numpy as np
import pytest

from unbend.errors import InputError
from unbend.report import collection_figures, draw_distances, draw_similarities


@pytest.mark.parametrize("n", [5, 25])
def test_the_alike_stand_together(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list = []
    monkeypatch.setattr(collection_figures, "save_figure", lambda one, path: drawn.append(one))
    kinds = np.arange(n) % 2
    table = np.where(kinds[:, None] == kinds, 0.9, 0.3)
    np.fill_diagonal(table, 1)
    table[0, 1] = table[1, 0] = np.nan
    draw_similarities([f"{kind}" for kind in kinds], table, "any.png")
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
    for names, table in ((["a", "b"], [[1]]), (["a"], [[1]])):
        with pytest.raises(InputError, match=f"{len(names)} names need a table of shape"):
            draw(names, table, "a.png")
