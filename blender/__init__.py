"""Blender extension: match shapes in any pose, and transfer, register and unbend them.

All operators read original meshes, without modifiers and shape keys, in world coordinates.
"""

import hashlib

import bpy
import numpy as np

import unbend
from unbend.alignment import procrustes
from unbend.errors import UnbendError, heard, warn
from unbend.report import match_colors

from . import carry

_DOUBTFUL = 0.6
_KEPT = 16
# Of the last shapes, by their contents, and what was said of each.
_matches: dict[bytes, tuple[unbend.Match, list[str]]] = {}


def find_match(source, target, progress=None) -> unbend.Match:
    """Match two objects, or give the match again if neither changed since."""
    shapes = carry.to_mesh(source), carry.to_mesh(target)
    ours, theirs = carry.landmarks(source), carry.landmarks(target)
    pairs = {name: (ours[name], theirs[name]) for name in ours if name in theirs}
    parts = [part for one in shapes for part in (one.vertices, one.faces)]
    shape = repr([pairs, *(part.shape for part in parts)]).encode()
    key = hashlib.sha256(shape + b"".join(part.tobytes() for part in parts)).digest()
    if key not in _matches:
        with heard() as said:
            found = unbend.match(
                *shapes,
                landmarks=pairs or None,
                barycentric=True,
                progress=progress,
            )
        _matches[key] = found, said
        if len(_matches) > _KEPT:
            del _matches[next(iter(_matches))]
    found, said = _matches[key]
    for text in said:
        warn(text)
    return found


class _Operator:
    """What all operators do: compute everything, then change the objects; report errors."""

    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012
    needs_two = True

    @classmethod
    def poll(cls, context):
        """Whether the meshes that it needs are selected."""
        active = context.active_object
        if active is None or active.type != "MESH" or context.mode != "OBJECT":
            return False
        chosen = cls.chosen(context)
        return bool(chosen) and all(one.mode == "OBJECT" for one in chosen)

    @classmethod
    def chosen(cls, context) -> list:
        """Give the selected meshes, without the active one if that is the other of a pair."""
        meshes = [one for one in context.selected_objects if one.type == "MESH"]
        return [one for one in meshes if one != context.active_object or not cls.needs_two]

    def execute(self, context):
        """Prepare a change for each object, then make all of them."""
        active = context.active_object
        window = context.window_manager
        window.progress_begin(0, 1)
        self.painted = None  # colours of the active object by the matches so far
        try:
            with heard() as said:
                changes = [
                    self.prepare(active, one, lambda _, share: window.progress_update(share))
                    for one in self.chosen(context)
                ]
        except UnbendError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        finally:
            window.progress_end()
        for message in said:
            self.report({"WARNING"}, message)
        for change in changes:
            change()
        return {"FINISHED"}

    def matched(self, source, target, progress) -> unbend.Match:
        """Match, and report the confidence."""
        found = find_match(source, target, progress)
        text = f"{source.name} to {target.name}: confidence {found.confidence:.2f}"
        if found.confidence < _DOUBTFUL:
            self.report(
                {"WARNING"},
                f"{text}; paint the match, and give both objects vertex groups of one name that "
                f'begins with "{carry.LANDMARK}" where they correspond',
            )
        else:
            self.report({"INFO"}, text)
        return found


class OBJECT_OT_unbend_match(_Operator, bpy.types.Operator):  # noqa: N801
    """Store each vertex's partner on the active object: the attribute unbend_partner, -1 for none."""  # noqa: E501

    bl_idname = "object.unbend_match"
    bl_label = "Match"

    paint: bpy.props.BoolProperty(
        name="Paint Both", description="Give corresponding places one colour", default=True
    )

    def prepare(self, active, other, progress):
        """Match the active object to another one."""
        for one in (other, active) if self.paint else (other,):
            carry.check_changeable(one)
        found = self.matched(active, other, progress)
        colors = match_colors(carry.to_mesh(active), carry.to_mesh(other), found)
        own = colors[0]  # grey is what none of the others has
        if self.painted is not None:
            own = np.where((found.source_to_target >= 0)[:, None], own, self.painted)
        self.painted = own

        def change():
            data = other.data
            old = data.attributes.get("unbend_partner")
            if old is not None:
                data.attributes.remove(old)
            new = data.attributes.new("unbend_partner", "INT", "POINT")
            new.data.foreach_set("value", found.target_to_source.astype(np.int32))
            if self.paint:
                for one, rgb in ((active, own), (other, colors[1])):
                    rgba = np.column_stack([rgb / 255, np.ones(len(rgb))])
                    layer = carry.set_colors(one.data, "unbend_match", rgba, field="color_srgb")
                    one.data.color_attributes.active_color = layer

        return change


class OBJECT_OT_unbend_transfer(_Operator, bpy.types.Operator):  # noqa: N801
    """Transfer data from the active object to the others selected, in any pose."""

    bl_idname = "object.unbend_transfer"
    bl_label = "Transfer"

    vertex_groups: bpy.props.BoolProperty(name="Vertex Groups", default=True)
    uvs: bpy.props.BoolProperty(name="UV Maps", default=True)
    colors: bpy.props.BoolProperty(name="Color Attributes", default=True)
    shape_keys: bpy.props.BoolProperty(name="Shape Keys", default=True)

    def prepare(self, source, target, progress):
        """Match the active object to another one, and place the other's vertices on it."""
        carry.check_room(source, target, self.uvs, self.shape_keys)
        found = self.matched(source, target, progress)
        shapes = carry.to_mesh(source), carry.to_mesh(target)

        def take(values):
            return unbend.transfer(values, found, kind="scalar", source=shapes[0], target=shapes[1])

        places = take(carry.to_world(source))

        def change():
            with heard():  # those of this match are reported already
                if self.vertex_groups and source.vertex_groups:
                    carry.carry_vertex_groups(source, target, take)
                if self.uvs and source.data.uv_layers:
                    carry.carry_uvs(source, target, places)
                if self.colors and source.data.color_attributes:
                    carry.carry_colors(source, target, places, take)
                if self.shape_keys and source.data.shape_keys:
                    carry.carry_shape_keys(source, target, places, take)

        return change


class OBJECT_OT_unbend_register(_Operator, bpy.types.Operator):  # noqa: N801
    """Make a copy of the active object that lies on each of the other selected ones."""

    bl_idname = "object.unbend_register"
    bl_label = "Register"

    def prepare(self, template, scan, progress):
        """Deform the template's vertices onto the scan."""
        found = self.matched(template, scan, progress)
        shapes = carry.to_mesh(template), carry.to_mesh(scan)
        result = unbend.register(*shapes, found, progress=progress)
        self.report({"INFO"}, f"{result.coverage:.0%} of {template.name} lies on {scan.name}")

        def change():
            data = template.data.copy()
            new = bpy.data.objects.new(f"{template.name} on {scan.name}", data)
            new.shape_key_clear()
            new.matrix_world = template.matrix_world  # but for its shear, which needs a parent
            places = result.mesh.vertices
            data.vertices.foreach_set("co", carry.to_local(new.matrix_basis, places).ravel())
            data.update()
            own = [one for one in template.users_collection if one.library is None]
            for collection in own or [bpy.context.collection]:
                collection.objects.link(new)
            for slot, old in zip(new.material_slots, template.material_slots, strict=True):
                slot.link, slot.material = old.link, old.material

        return change


class OBJECT_OT_unbend_canonical(_Operator, bpy.types.Operator):  # noqa: N801
    """Give each selected mesh its pose-free canonical form as a shape key."""

    bl_idname = "object.unbend_canonical"
    bl_label = "Canonical Form"
    needs_two = False

    def prepare(self, _, thing, progress):
        """Compute the form, as large as the mesh and turned like it."""
        carry.check_changeable(thing)
        mesh = carry.to_mesh(thing)
        points = unbend.canonical_form(mesh, component="largest", progress=progress).points
        known = np.isfinite(points).all(axis=1)
        form, rest = (one[known] - one[known].mean(axis=0) for one in (points, mesh.vertices))
        turn, _ = procrustes(form, rest)
        form *= np.linalg.norm(rest) / np.linalg.norm(form)
        places = mesh.vertices.copy()
        places[known] = form @ turn.T + mesh.vertices[known].mean(axis=0)

        def change():
            local = carry.to_local(thing.matrix_world, places)
            carry.set_shape_key(thing, "canonical", local).value = 1

        return change


class VIEW3D_PT_unbend(bpy.types.Panel):  # noqa: N801
    """The buttons, in the sidebar of the 3-D view."""

    bl_label = "Unbend"
    bl_category = "Unbend"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"

    def draw(self, context):
        """Show what the active object is for, then a button for each operator."""
        active = context.active_object
        name = active.name if active else "none"
        self.layout.label(text=f"From {name} to the others selected", icon="MESH_DATA")
        for operator in OPERATORS:
            self.layout.operator(operator.bl_idname)


OPERATORS = (
    OBJECT_OT_unbend_match,
    OBJECT_OT_unbend_transfer,
    OBJECT_OT_unbend_register,
    OBJECT_OT_unbend_canonical,
)


def register() -> None:
    """Blender calls this when the extension is switched on."""
    for one in (*OPERATORS, VIEW3D_PT_unbend):
        bpy.utils.register_class(one)


def unregister() -> None:
    """Blender calls this when it is switched off."""
    for one in (VIEW3D_PT_unbend, *reversed(OPERATORS)):
        bpy.utils.unregister_class(one)
