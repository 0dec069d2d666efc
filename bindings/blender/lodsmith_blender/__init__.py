"""Lodsmith in Blender: Object > Lodsmith reduces the triangles of the selected meshes."""

import warnings

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from . import transfer


class OBJECT_OT_lodsmith(bpy.types.Operator):
    """Reduce the triangles of the selected meshes, and keep them as close to the original as possible"""

    bl_idname = "object.lodsmith"
    bl_label = "Lodsmith"
    bl_options = {"REGISTER", "UNDO"}

    target: EnumProperty(
        name="Target",
        items=[
            ("RATIO", "Ratio", "Keep this fraction of the triangles"),
            ("FACES", "Faces", "Keep this number of triangles of each mesh"),
            ("ERROR", "Error", "Keep as many triangles as a largest distance requires"),
        ],
        default="RATIO",
    )
    ratio: FloatProperty(name="Ratio", default=0.5, min=0.0001, max=1.0, subtype="FACTOR")
    faces: IntProperty(name="Faces", default=10_000, min=1)
    error: FloatProperty(
        name="Error (%)",
        description="Largest distance, in percent of the diagonal of the bounding box of the mesh",
        default=0.1,
        min=0.00001,
        max=100.0,
        precision=4,
    )
    preset: EnumProperty(
        name="Preset",
        items=[
            ("auto", "Automatic", "Smallest distance from the original"),
            ("scan", "Scan", "Scanned surfaces"),
            ("cad", "CAD", "Flat and ruled surfaces with sharp edges"),
            ("visual", "Visual", "Best appearance: more weight on normals"),
            ("print", "Print", "Closed surfaces for 3D printing"),
        ],
        default="auto",
    )
    lock_border: BoolProperty(
        name="Lock Borders", description="Do not move vertices on open borders", default=False
    )
    keep_topology: BoolProperty(
        name="Keep Topology", description="Keep all holes, handles and separate parts", default=False
    )

    @classmethod
    def poll(cls, context):
        return context.mode == "OBJECT" and any(o.type == "MESH" for o in context.selected_objects)

    def engine_options(self):
        """Return the options of the engine."""
        options = {"preset": self.preset}
        if self.target == "RATIO":
            options["ratio"] = self.ratio
        elif self.target == "FACES":
            options["faces"] = self.faces
        else:
            options["error"] = f"{self.error}%"
        if self.lock_border:
            options["border"] = "lock"
        if self.keep_topology:
            options["topology"] = "preserve"
        return options

    def execute(self, context):
        by_mesh = {}
        for o in context.selected_objects:
            if o.type == "MESH":
                by_mesh.setdefault(o.data, []).append(o)
        before = after = 0
        changed = 0
        for mesh, objects in by_mesh.items():
            if mesh.library is not None or any(not o.is_editable for o in objects):
                self.report({"WARNING"}, f"{objects[0].name}: not changed, because it is linked from another file")
                continue
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                try:
                    counts = transfer.simplify(objects, self.engine_options())
                except ValueError as error:
                    self.report({"ERROR"}, f"{objects[0].name}: {error}")
                    continue
            for warning in caught:
                self.report({"WARNING"}, f"{objects[0].name}: {warning.message}")
            before, after, changed = before + counts[0], after + counts[1], changed + 1
        if not changed:
            return {"CANCELLED"}
        self.report({"INFO"}, f"{before:,} → {after:,} triangles")
        return {"FINISHED"}

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "target")
        layout.prop(self, self.target.lower())
        layout.prop(self, "preset")
        layout.prop(self, "lock_border")
        layout.prop(self, "keep_topology")


def in_menu(self, context):
    self.layout.operator(OBJECT_OT_lodsmith.bl_idname)


def register():
    bpy.utils.register_class(OBJECT_OT_lodsmith)
    bpy.types.VIEW3D_MT_object.append(in_menu)


def unregister():
    bpy.types.VIEW3D_MT_object.remove(in_menu)
    bpy.utils.unregister_class(OBJECT_OT_lodsmith)
