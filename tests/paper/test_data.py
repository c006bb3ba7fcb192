"""What a folder holds is found wherever it lies, and what does not belong there is named."""

import numpy as np
import pytest

from paper import synthetic
from paper.data import open_data, without_strangers
from tests.paper import folders
from tests.paper.folders import write_animals, write_edited, write_people
from unbend.datasets import make_quadruped
from unbend.errors import FileError


def silent(step: str) -> None:
    pass


def test_collections_are_found_in_folders_of_their_names(tmp_path):
    write_animals(tmp_path / "TOSCA" / "Meshes")
    write_people(tmp_path / "SCAPE")
    found = open_data(str(tmp_path), tmp_path / "out" / "pieces", False, silent)
    assert found.shapes is not None
    assert found.shapes.collection.names == ("dog0", "dog1", "dog2")
    assert found.shapes.about == "TOSCA: 3 shapes of 1 kind, 600 vertices, numbered alike"
    assert found.shapes.left_out == ()
    (caveat,) = found.shapes.caveats
    assert "numbered and placed alike" in caveat
    assert found.scape is not None
    assert len(found.scape.collection) == 3
    assert (tmp_path / "out" / "pieces" / ".gitignore").read_text() == "*\n"


def test_a_folder_of_scape_alone_is_not_taken_for_tosca(tmp_path):
    found = open_data(str(write_people(tmp_path / "SCAPE")), tmp_path, False, silent)
    assert found.shapes is None
    assert found.scape is not None


def test_a_quick_run_prefers_the_small_shapes(tmp_path):
    write_animals(tmp_path / "TOSCA")
    small = write_animals(tmp_path / "tosca_remeshed")
    (small / "corres").mkdir()
    found = [open_data(str(tmp_path), tmp_path, quick, silent).shapes for quick in (True, False)]
    folders = [one.collection.files["dog0"].parent.name for one in found if one]
    assert folders == ["tosca_remeshed", "TOSCA"]
    assert [caveat.split()[:2] for caveat in found[0].caveats] == [["The", "paper"], ["A", "quick"]]
    assert [caveat.split()[0] for caveat in found[1].caveats] == ["As"]


def test_each_set_of_shapes_has_a_store_of_its_own(tmp_path):
    write_animals(tmp_path / "one")
    write_animals(tmp_path / "two")
    write_edited(tmp_path / "two" / "dog1.off")
    stores = [
        open_data(str(tmp_path / name), tmp_path / "pieces", False, silent).store
        for name in ("one", "one", "two")
    ]
    assert stores[0] == stores[1] != stores[2]


def test_an_edited_shape_is_left_out_and_named(tmp_path):
    write_animals(tmp_path)
    write_edited(tmp_path / "dog7.off")
    found = open_data(str(tmp_path), tmp_path / "pieces", False, silent).shapes
    assert found is not None
    assert found.collection.names == ("dog0", "dog1", "dog2")
    (note,) = found.left_out
    assert note.startswith("dog7 was left out: it has 601 vertices where its class has 600")


def test_the_shifted_number_of_scape_is_pointed_out(tmp_path):
    write_people(tmp_path)
    collection = open_data(str(tmp_path), tmp_path / "pieces", False, silent).scape.collection
    sizes = dict.fromkeys(collection.names, 600)
    assert without_strangers(collection, sizes) == (collection, ())
    kinds = {f"mesh{i:03d}": "person" for i in range(70, 74)}
    copy = type(collection)("SCAPE", kinds, dict.fromkeys(kinds), None)
    kept, notes = without_strangers(copy, dict(zip(kinds, (600, 500, 600, 510), strict=True)))
    assert kept.names == ("mesh070", "mesh072")
    assert len(notes) == 3
    assert "mesh072 of this copy" in notes[-1]


@pytest.mark.parametrize("name", ["", "nowhere"])
def test_without_shapes_it_is_said_what_to_put_where(tmp_path, name):
    with pytest.raises(FileError, match=r"TOSCA.*SCAPE.*--data synthetic"):
        open_data(str(tmp_path / name), tmp_path / "pieces", False, silent)
    assert not (tmp_path / "pieces").exists()


def test_our_own_shapes_have_their_true_and_mirrored_correspondences(tmp_path, monkeypatch):
    monkeypatch.setattr(synthetic, "_N_VERTICES", {True: 600})
    poses = ("standing", "walking")
    monkeypatch.setattr(synthetic, "_SPECIES", {"dog": (make_quadruped, {}, poses)})
    monkeypatch.setattr(synthetic, "_PEOPLE", ("standing", "sitting"))
    found = open_data("synthetic", tmp_path, True, silent)
    assert found.synthetic
    truth = found.shapes.collection.truth("dog0", "dog1")
    one = make_quadruped("standing", n_vertices=600)
    other = make_quadruped("walking", n_vertices=600, meshing=1)
    np.testing.assert_array_equal(truth.source_points, np.arange(600))
    apart = np.linalg.norm(one.rest - other.rest[truth.target_points], axis=1)
    swapped = np.linalg.norm(
        one.rest * [-1, 1, 1] - other.rest[truth.mirrored_target_points], axis=1
    )
    np.testing.assert_allclose(swapped[one.mirror], apart, atol=1e-9)
    assert apart.max() < 0.1
    person = found.scape.collection.mesh("mesh001")
    np.testing.assert_array_equal(person.vertices, folders.person("sitting").vertices)
    written = found.shapes.collection.files["dog1"].stat().st_mtime_ns
    again = open_data("synthetic", tmp_path, True, silent)
    assert again.shapes.collection.files["dog1"].stat().st_mtime_ns == written
