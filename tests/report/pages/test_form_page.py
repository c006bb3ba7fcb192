"""The form page tells of the form; its distances are the library's, but for what it leaves out."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sheets import cut_along_seam
from unbend import Mesh, canonical_form, distance
from unbend.datasets import make_sphere
from unbend.errors import InputError
from unbend.report import form_page
from unbend.report.pages._form_page import _embedding
from unbend.report.pages._shown import show


def test_straight_in_the_embedding_is_the_truncated_distance(blob: Mesh) -> None:
    big = Mesh(7 * blob.vertices, blob.faces)
    form = canonical_form(big)
    values, embedding = _embedding(big, form, np.ones(642, bool))
    assert values[0] == 0
    straight = np.linalg.norm(embedding - embedding[5], axis=1) * np.sqrt(form.area)
    (truncated,) = distance(big, 5, distance="biharmonic", n_eigenpairs=61)
    np.testing.assert_allclose(straight, truncated, atol=1e-7 * truncated.max())
    (exact,) = distance(big, 5, distance="biharmonic")
    assert np.abs(straight - exact).max() < 0.06 * exact.max()


def test_the_page_tells_of_the_form(blob: Mesh) -> None:
    two = Mesh(
        np.vstack([blob.vertices, make_sphere(1).vertices + 9]),
        np.vstack([blob.faces, make_sphere(1).faces + 642]),
        name="two <i>",
    )
    with pytest.warns(match="component 0 of 2"):
        form = canonical_form(two, component="largest", n_components=2)
    text = form_page(two, form, command="unbend canonical 'two <i>'").html
    assert "two <i>" not in text
    assert f"form of 642 vertices; stress {form.stress:.3f}" in text
    assert "component 0 of 2 was kept" in text
    assert f"<td>{form.eigenvalues[1]:.5g}</td>" in text
    assert text.count("<circle") == 61


def test_a_surface_is_drawn_and_computed_on_without_its_seams(blob: Mesh) -> None:
    cut, seam = cut_along_seam(blob)
    shown = show(cut)
    np.testing.assert_array_equal(shown.faces, blob.faces)
    np.testing.assert_array_equal(shown.ids, np.arange(642))
    np.testing.assert_array_equal(shown.stand_ins, [*range(642), *seam])
    with pytest.warns(match="the surface is joined there"):
        form = canonical_form(cut)
    spectra = [
        re.findall("<circle.*?>", form_page(mesh, one).html)
        for mesh, one in ((cut, form), (blob, canonical_form(blob)))
    ]
    assert spectra[0] == spectra[1]


def test_the_scale_that_was_kept_is_no_part_of_distances(blob: Mesh) -> None:
    kept = canonical_form(blob, keep_scale=True)
    unit = f'"unit": {float(np.sqrt(kept.area))!r}'
    assert unit in form_page(blob, kept, keep_scale=True).html
    assert '"unit": null' in form_page(blob, canonical_form(blob, distance="diffusion")).html


def test_what_does_not_fit_is_refused(blob: Mesh, tmp_path: Path) -> None:
    form, page = canonical_form(blob), tmp_path / "form.html"
    with pytest.raises(InputError, match="100 points"):
        form_page(blob, replace(form, points=form.points[:100]), page)
    with pytest.raises(InputError, match="up must be"):
        form_page(blob, form, page, up="w")
    assert not page.exists()
