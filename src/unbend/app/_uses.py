"""Jobs that use a map, and those on one shape."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from unbend import correspondence, io, report
from unbend.app._work import Landmarks, Result, Work, by_label
from unbend.canonical import canonical_form
from unbend.distances import distance as measure
from unbend.mesh import Mesh

_N_FOUND = 20  # shapes of a collection
_LARGEST = ("--component", "largest")


def distance(work: Work, landmarks: Landmarks) -> Result:
    work.progress("measuring", 0.0)
    (mesh,), (stem,) = work.meshes, work.stems
    vertices = list(dict.fromkeys(one["at"][0] for one in landmarks))
    field = measure(mesh, vertices, component="largest")
    nearest, names = field.min(axis=0), [f"distance_{vertex}" for vertex in vertices]
    looks: Any = {"landmarks": by_label(landmarks), "label": "distance", "up": work.up}
    report.view(mesh, values=nearest, path=work.page, **looks)
    about = "the distance of each vertex"
    table, painted = (work.new_file(f"{stem}-distance{one}", about) for one in (".csv", ".ply"))
    io.write_values(table, field.T, mesh, names=names)
    io.write_mesh(painted, mesh, scalars=dict(zip(names, field, strict=True)))
    io.write_values(work.new_file(f"{stem}-distance.glb", f"{about}, as colours"), nearest, mesh)
    at = int(np.nanargmax(nearest))
    facts = {"farthest": f"vertex {at}, at {nearest[at]:.5g} in the unit of the file"}
    starts = [word for one in vertices for word in ("--from", str(one))]
    command = ["distance", mesh.name, *starts, *_LARGEST, "-o", f"{stem}-distance.ply"]
    options = f'{vertices}, component="largest"'
    call = f"distances = distance({mesh.name!r}, {options})"
    python = ["from unbend import distance", call]
    return work.result(f"Distances on {mesh.name}", command, python, facts)


def form(work: Work) -> Result:
    (mesh,), (stem,) = work.meshes, work.stems
    found = canonical_form(mesh, component="largest", progress=work.progress)
    there = np.asarray(np.isfinite(found.points).all(axis=1))
    faces = mesh.faces[there[mesh.faces].all(axis=1)]
    colors = np.rint(255 * report.position_colors(mesh.vertices)).astype(np.uint8)
    bare = Mesh(found.points, faces, name=stem)
    about = "the canonical form in the colours of the shape"
    work.keep_mesh(f"{stem}-canonical", about, bare, colors)
    io.write_values(work.new_file(f"{stem}-canonical.csv", "its coordinates"), found.points, mesh)
    report.form_page(mesh, found, work.page, up=work.up, progress=work.progress)
    command = ["canonical", mesh.name, *_LARGEST, "-o", f"{stem}-canonical.ply"]
    call = f'form = canonical_form({mesh.name!r}, component="largest")'
    python = ["from unbend import canonical_form", call]
    facts = {"stress, 0 if perfect": f"{found.stress:.3f}"}
    return work.result(f"Canonical form of {mesh.name}", command, python, facts)


def search(work: Work, store: str) -> Result:
    from unbend.collection import Collection, find_file, read_found

    (mesh,) = work.meshes
    hits = Collection(store).search(mesh, _N_FOUND, progress=work.progress)
    found, failures = read_found(hits, store)
    report.search_page(mesh, found, [hit.distance for hit in hits], work.page, up=work.up)
    command = ["collection", "search", store, mesh.name, "-n", str(_N_FOUND)]
    call = f"hits = Collection({store!r}).search({mesh.name!r}, {_N_FOUND})"
    python = ["from unbend.collection import Collection", call]
    lost = {failure.path for failure in failures}
    result = work.result(f"Most like {mesh.name}", command, python)
    result["found"] = [
        {"path": find_file(hit, store), "name": one.name}
        for hit, one in zip(hits, found, strict=True)
        if hit.path not in lost
    ]
    return result


def groups(work: Work, store: str) -> Result:
    from unbend.collection import Collection, find_groups, read_found

    work.progress("comparing", 0.0)
    entries, distances = Collection(store).distances()
    report.check_count(len(entries))  # before they are read
    numbers = find_groups(distances).tolist()
    pairs: list[tuple[str, int]] = []
    for one, number in zip(entries, numbers, strict=True):
        pairs += [(path, number) for path in (one.path, *one.also)]
    table = work.new_file("groups.csv", "the group of each shape")
    io.write_table(table, [("path", "group"), *sorted(pairs)])
    meshes, _ = read_found(entries, store)
    looks: Any = {"groups": numbers, "up": work.up, "progress": work.progress}
    report.similarity_page(meshes, distances, work.page, measure="distance", **looks)
    python = [
        "from unbend.collection import Collection, find_groups",
        f"entries, distances = Collection({store!r}).distances()",
        "groups = find_groups(distances)",
    ]
    command = ["collection", "groups", store, "--csv", "groups.csv", *work.report]
    return work.result("Groups of the collection", command, python)


def transfer(work: Work, values: Sequence[str] | None = None, column: str | None = None) -> Result:
    """Carry values to the second shape: those of a file, or of the first shape's file."""
    work.progress("carrying", 0.0)
    (source, target), found = work.meshes, work.read_map()
    path, name = values or (work.paths[0], source.name)
    stem = f"{work.stems[1]}-{Path(name).stem.removesuffix('.mrk')}"
    markups = path.lower().endswith(io.MARKUP_SUFFIXES)
    out = f"{stem}.mrk.json" if markups else f"{stem}.csv"
    command = ["transfer", *work.names, "--map", work.map_name, "--values", name, "-o", out]
    if markups:
        labels, rows = io.read_markups(path, source)
        kept, at = correspondence.transfer_landmarks(labels, rows, found, target)
        io.write_markups(work.new_file(out, "the landmarks, for 3D Slicer"), target, at, kept)
        by_label = dict(zip(kept, at.tolist(), strict=True))  # several may have one label
        shown: Any = by_label if len(by_label) == len(kept) else at
        report.view(target, landmarks=shown, path=work.page, up=work.up)
        facts = {"carried": f"{len(kept)} of {len(labels)} landmarks"}
        python = work.python(
            "correspondence, io, read_match, read_mesh",
            f"landmarks = io.read_markups({name!r}, source)  # labels and vertices",
            "carried = correspondence.transfer_landmarks(*landmarks, found, target)",
        )
        return work.result(f"{name} on {target.name}", command, python, facts)
    array, names = io.read_named_values(path, n_vertices=source.n_vertices, name=column)
    kind = correspondence.value_kind(array, names=names)
    carried = correspondence.transfer(array, found, kind=kind, source=source, target=target)
    drawable = kind == "color" or array.ndim == 1
    suffixes = [".csv", ".npy"]
    suffixes += [".obj", ".glb"] if kind == "uv" else [".ply"] * (array.dtype.kind != "U")
    for suffix in [*suffixes, *([".glb"] if drawable else [])]:
        file = work.new_file(stem + suffix, "the values")
        io.write_values(file, carried, target, kind=kind, names=names)
    if drawable:
        both = np.concatenate([array, carried])  # one scale of colours
        colors = both[:, :3] if kind == "color" else io.value_colors(both, kind=kind)
        for mesh, own in zip(work.meshes, np.split(colors, [len(array)]), strict=True):
            work.draw(mesh.name, mesh, own)
    reached = int((found.target_to_source >= 0).sum())
    facts = {"carried": f"to {reached:,} of {len(carried):,} vertices, as {kind}"}
    named = f", name={column!r}" if column else ""
    command += ["--property", column] if column else []
    python = work.python(
        "io, read_match, read_mesh, transfer",
        f"values = io.read_values({name!r}{named})",
        f"carried = transfer(values, found, kind={kind!r}, source=source, target=target)",
    )
    return work.result(f"{name} on {target.name}", command, python, facts)


def register(work: Work) -> Result:
    source, target = work.meshes
    found = correspondence.register(source, target, work.read_map(), progress=work.progress)
    stem = "-on-".join(work.stems)
    for suffix in (".ply", ".obj", ".glb"):
        like = work.like(stem + suffix, 0)
        about = "coloured by the distance from the second shape"
        kept = f"with all else of {source.name}"
        path = work.new_file(stem + suffix, about if like is None else kept)
        correspondence.write_registration(path, found, like=like)
    reach = f"{found.tolerance:.3g}"
    covered = (
        f"{found.coverage:.1%} of the area, within {reach}, "
        f"and {found.scan_coverage:.1%} of its area covered, within a mean edge"
    )
    looks: Any = {"label": f"distance from {target.name}, up to {reach}", "up": work.up}
    looks |= {"note": f"On {target.name}: {covered}.", "path": work.page}
    report.view(found.mesh, target, values=found.distances.clip(max=found.tolerance), **looks)
    facts = {
        "on the second shape": covered,
        "mean distance": f"{np.nanmean(found.distances):.3g} in the unit of the file",
    }
    command = ["register", *work.names, "--map", work.map_name, "-o", f"{stem}.ply"]
    call = "fitted = register(source, target, found)"
    python = work.python("read_match, read_mesh, register", call)
    return work.result(" fitted to ".join(work.names), command, python, facts)


def morph(work: Work, steps: int) -> Result:
    (source, target), found = work.meshes, work.read_map()
    stem, colors = "-to-".join(work.stems), report.match_colors(source, target, found)
    work.draw(source.name, source, colors[0])
    for i in range(1, steps + 1):
        work.progress("morphing", i / (steps + 1))
        between = correspondence.morph(source, target, found, i / (steps + 1))
        share = f"{i / (steps + 1):.0%} of the way"
        work.keep_mesh(stem if steps == 1 else f"{stem}-{i}", share, between, colors[0])
        work.draw(share, between, colors[0])
    work.draw(target.name, target, colors[1])
    command = ["morph", *work.names, "--map", work.map_name, "--steps", str(steps)]
    call = f"[morph(source, target, found, i / {steps + 1}) for i in range(1, {steps + 1})]"
    python = work.python("morph, read_match, read_mesh", f"between = {call}")
    return work.result(
        f"Between {' and '.join(work.names)}", [*command, "-o", f"{stem}.ply"], python
    )
