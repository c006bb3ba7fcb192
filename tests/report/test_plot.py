"""In a notebook results are tables; each is drawn when asked."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from unbend import Mesh, canonical_form, evaluate, match, plot
from unbend.errors import InputError
from unbend.matching import Hypothesis
from unbend.report import new_figure


@pytest.fixture(autouse=True)
def _small(monkeypatch):
    """Draw with few pixels: their looks are tested elsewhere."""
    monkeypatch.setitem(new_figure.__kwdefaults__, "dpi", 30)


@pytest.fixture(scope="module")
def things(blob):
    every = np.arange(642)
    tried = (Hypothesis(0.2, 0.9), Hypothesis(0.3, -0.8))
    return {
        "mesh": Mesh(blob.vertices, blob.faces, name="blob <i>"),
        "points": Mesh(blob.vertices, name="points <i>"),
        "pair": (blob.vertices, blob.faces),
        "form": canonical_form(blob),
        "flat form": canonical_form(blob, n_components=2),
        "match": replace(match(blob, blob, refine=False), hypotheses=tried),
        "evaluation": evaluate(every, blob, every, every, np.roll(every, 1)),
    }


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("mesh", "642 vertices, 1,280 faces"),
        ("points", "642"),
        ("form", "642 points in 3 dimensions"),
        ("flat form", "642 points in 2 dimensions"),
        ("match", "energy 30.0%"),
        ("evaluation", "vertex-min"),
    ],
)
def test_everything_shows_itself(things, name, words):
    html = things[name]._repr_html_()
    assert words in html
    assert "<i>" not in html
    assert html.startswith("<table>")


@pytest.mark.parametrize(
    "name", ["mesh", "points", "pair", "form", "flat form", "match", "evaluation"]
)
def test_everything_can_be_drawn(things, name, tmp_path):
    figure = plot(things[name])
    figure.savefig(tmp_path / "picture.png", dpi=30)
    assert figure.axes
    assert (tmp_path / "picture.png").stat().st_size > 1000
    again = pickle.loads(pickle.dumps(figure))
    for one in (figure, again):
        assert one._repr_png_().startswith(b"\x89PNG")  # what notebooks ask for


def test_the_table_of_a_match_tells_what_is_left_out_and_what_is_mirrored(things):
    html = things["match"]._repr_html_()
    assert "another map" in html
    assert "right side out" in html
    assert "overlap" not in html
    other = replace(things["match"], orientation=-1.0, overlap_target=0.57)._repr_html_()
    assert "<td>100% of the source&#x27;s area, 57% of the target&#x27;s</td>" in other
    assert "mirrored" in other
    assert "right side out" not in other


def test_a_plotted_match_is_its_functional_map(things):
    (picture,) = plot(things["match"]).axes[0].get_images()
    np.testing.assert_array_equal(picture.get_array(), things["match"].functional_map)


def test_what_cannot_be_shown_is_refused():
    with pytest.raises(InputError, match="a dict is not a mesh"):
        plot({})


def test_a_form_of_one_dimension_has_one_axis(blob):
    (ax,) = plot(canonical_form(blob, n_components=1)).axes
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("first coordinate", "")
