"""GIFTI and FreeSurfer's files, in which surfaces of brains and their values are kept."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from unbend import as_mesh, read_mesh
from unbend.errors import FileError, InputError
from unbend.io import read_values

QUAD = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float32)
FACES = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
POINTSET, TRIANGLE, LABEL, SHAPE, NODE_INDEX = 1008, 1009, 1002, 2005, 2002


def array(intent, data, **meta):
    return SimpleNamespace(intent=intent, data=data, meta=meta)


def write_gifti(path: Path, *arrays) -> None:
    nibabel = pytest.importorskip("nibabel")
    made = [
        nibabel.gifti.GiftiDataArray(one.data, one.intent, meta=one.meta or None) for one in arrays
    ]
    nibabel.save(nibabel.GiftiImage(darrays=made), path)


SURFACE = (array(TRIANGLE, FACES), array(POINTSET, QUAD))


def test_an_image_of_nibabel_is_a_mesh() -> None:
    mesh = as_mesh(SimpleNamespace(darrays=SURFACE))
    np.testing.assert_array_equal(mesh.vertices, QUAD)
    np.testing.assert_array_equal(mesh.faces, FACES)
    for more in SURFACE:  # the last one would be taken, on the faces of another
        with pytest.raises(InputError, match="holds several surfaces: save each in a file"):
            as_mesh(SimpleNamespace(darrays=[*SURFACE, more]))
    with pytest.raises(InputError, match="without points"):
        as_mesh(SimpleNamespace(darrays=[array(SHAPE, QUAD[:, 0])]))


def test_a_gifti_surface_is_read(tmp_path: Path) -> None:
    write_gifti(tmp_path / "lh.surf.gii", *SURFACE)
    mesh = read_mesh(tmp_path / "lh.surf.gii")
    np.testing.assert_array_equal(mesh.vertices, QUAD)
    np.testing.assert_array_equal(mesh.faces, FACES)
    assert mesh.notes == ("read by nibabel",)
    with pytest.raises(FileError, match=r"^lh\.surf\.gii: holds no values per vertex"):
        read_values(tmp_path / "lh.surf.gii")


def test_a_gifti_file_of_values_needs_no_surface(tmp_path: Path) -> None:
    thickness = np.array([2.5, 3, 1.5, np.nan], dtype=np.float32)
    path = tmp_path / "lh.shape.gii"
    write_gifti(path, array(SHAPE, thickness))
    np.testing.assert_array_equal(read_values(path, n_vertices=4), thickness)
    with pytest.raises(FileError, match=r"^lh\.shape\.gii: holds values and no surface: give the"):
        read_mesh(path)
    with pytest.raises(FileError, match="holds 4 rows, but there are 5 vertices"):
        read_values(path, n_vertices=5)
    write_gifti(path, array(SHAPE, thickness), array(SHAPE, thickness[:3]))
    with pytest.raises(FileError, match=r"^lh\.shape\.gii: its arrays of values differ in length"):
        read_values(path)


def test_labels_are_whole_numbers_that_are_never_averaged(tmp_path: Path) -> None:
    path, map_1 = tmp_path / "a.label.gii", array(LABEL, np.array([3, 3, 0, -1], dtype=np.int32))
    write_gifti(path, map_1)
    labels = read_values(path)
    assert labels.dtype == np.int64
    assert labels.tolist() == [3, 3, 0, -1]
    for names in (("", ""), ("parts_0", "parts_1")):  # columns of one name would be
        maps = zip((np.array([3, 3, 0, -1], dtype=np.int32), FACES.ravel()[:4]), names, strict=True)
        write_gifti(path, *(array(LABEL, values, Name=name) for values, name in maps))
        with pytest.raises(FileError, match="holds value_1, value_2; name one of them"):
            read_values(path)
    np.testing.assert_array_equal(read_values(path, name="value_2"), FACES.ravel()[:4])


def test_several_arrays_go_by_name_or_are_columns(tmp_path: Path) -> None:
    x, y = QUAD[:, 0], QUAD[:, 1]
    path = tmp_path / "a.func.gii"
    write_gifti(path, array(SHAPE, x, Name="curvature"), array(SHAPE, y, Name="depth"))
    np.testing.assert_array_equal(read_values(path, name="depth"), y)
    with pytest.raises(FileError, match="holds curvature, depth; name one of them"):
        read_values(path)
    write_gifti(path, array(SHAPE, x), array(SHAPE, y))  # as time series are written
    np.testing.assert_array_equal(read_values(path), QUAD[:, :2])


def test_rows_that_name_their_vertices_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.gii"
    write_gifti(path, array(NODE_INDEX, np.array([2, 0], np.int32)), array(SHAPE, QUAD[:2, 0]))
    with pytest.raises(FileError, match="NODE_INDEX"):
        read_values(path)


@pytest.mark.parametrize("suffix", [".gii", ".pial", ".curv", ".annot"])
def test_a_broken_file_is_one_sentence(tmp_path: Path, suffix: str) -> None:
    pytest.importorskip("nibabel")
    # A link to a file that is kept elsewhere, as data are published.
    (tmp_path / f"lh{suffix}").write_text("/annex/objects/MD5E-s453060--58f2\n")
    with pytest.raises(FileError, match=rf"^lh\{suffix}: (nibabel cannot read it|not FreeSurfer)"):
        read_values(tmp_path / f"lh{suffix}")


def test_files_of_freesurfer_are_read(tmp_path: Path) -> None:
    freesurfer = pytest.importorskip("nibabel").freesurfer
    freesurfer.write_geometry(tmp_path / "lh.pial", QUAD, FACES)
    mesh = read_mesh(tmp_path / "lh.pial")
    np.testing.assert_array_equal(mesh.vertices, QUAD)
    np.testing.assert_array_equal(mesh.faces, FACES)
    freesurfer.write_morph_data(tmp_path / "lh.thickness", QUAD[:, 0])
    thickness = read_values(tmp_path / "lh.thickness")
    np.testing.assert_array_equal(thickness, QUAD[:, 0])
    assert thickness.dtype == np.float64  # the file's other byte order is refused by PyTorch
    (tmp_path / "cut.curv").write_bytes((tmp_path / "lh.thickness").read_bytes()[:-4])
    with pytest.raises(FileError, match=r"^cut\.curv: truncated"):
        read_values(tmp_path / "cut.curv")
    table = np.array([[25, 5, 25, 0], [220, 20, 10, 0]])
    labels = np.array([1, 0, -1, 1])
    freesurfer.write_annot(tmp_path / "lh.annot", labels, table, ["a", "b"], fill_ctab=True)
    np.testing.assert_array_equal(read_values(tmp_path / "lh.annot"), labels)
    given = (tmp_path / "lh.annot").read_bytes()
    unknown = given.replace(b"\0\x0a\x14\xdc", b"\0\x0a\x14\xdb", 1)  # of vertex 0: none of a row
    (tmp_path / "lh.annot").write_bytes(unknown)
    np.testing.assert_array_equal(read_values(tmp_path / "lh.annot"), [-1, 0, -1, 1])
