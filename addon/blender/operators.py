# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel's buttons do."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import EnumProperty, StringProperty

from ..native import load
from ..study.job import Job
from ..study.output import write_text_aside
from ..study.report import write_report
from ..study.run import Study
from ..study.spreadsheet import rows_csv
from ..study.table import text_report
from . import images, preferences, store, summary
from .extract import extract_scene
from .panel_state import COLUMNS
from .session import program
from .text import sentence

POLL_SECONDS = 0.1


class Watch:
    """What a running comparison holds of a window: a timer, and the status bar's text."""

    def __init__(self) -> None:
        self._timer: bpy.types.Timer | None = None
        self._workspace = ""  # whose status bar shows our text

    def start(self, context: bpy.types.Context) -> None:
        """From now on the window sends TIMER events."""
        self._timer = context.window_manager.event_timer_add(POLL_SECONDS, window=context.window)

    def show(self, workspace: bpy.types.WorkSpace, text: str) -> None:
        """Write into the status bar, and take the text out of a workspace that was left."""
        if workspace.name != self._workspace:
            self._clear_text()
        workspace.status_text_set(text)
        self._workspace = workspace.name

    def stop(self) -> None:
        """Give all of it back; also where Blender has no context, as when the add-on goes."""
        if self._timer is not None:
            bpy.context.window_manager.event_timer_remove(self._timer)
            self._timer = None
        self._clear_text()

    def _clear_text(self) -> None:
        workspace = bpy.data.workspaces.get(self._workspace)
        if workspace is not None:
            workspace.status_text_set(None)
        self._workspace = ""


watch = Watch()


class BVHLAB_OT_compare(bpy.types.Operator):
    """Modal with a window, synchronous without (or where a script calls it with EXEC_DEFAULT)."""

    bl_idname = "bvhlab.compare"
    bl_label = "Compare"
    bl_description = (
        "Build every chosen BVH of this scene, trace the same rays through each, and show which is "
        "fastest and whether its answers are right. ESC stops and keeps what was measured"
    )
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        reason = _why_not(context)
        if reason:
            cls.poll_message_set(reason)
        return not reason

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.app.background:
            return self.execute(context)
        if not self._start(context):
            return {"CANCELLED"}
        watch.start(context)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        running = store.running
        if running is None:  # another file was opened
            watch.stop()
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS":
            running.job.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        running.poll()
        context.window_manager.bvh_lab.show(running.scene, list(running.rows))
        watch.show(
            context.workspace,
            f"BVH Lab: {running.job.fraction:.0%}, {running.job.stage}   |   ESC: Stop",
        )
        _redraw(context)
        if running.job.running:
            if store.is_deleted(running.scene):
                running.job.cancel()
            return {"RUNNING_MODAL"}
        watch.stop()
        return self._finish(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self._start(context):
            return {"CANCELLED"}
        try:
            while store.running.job.running:
                store.running.job.wait(POLL_SECONDS)
                store.running.poll()
        except KeyboardInterrupt:
            store.running.job.cancel()  # the rows measured so far stay
        return self._finish(context)

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends the operator: the file or the window is being closed."""
        store.stop()
        watch.stop()

    def _start(self, context: bpy.types.Context) -> bool:
        settings = context.scene.bvh_lab
        try:
            plan = settings.plan()
            core = load()
            plan.check(core.builders(), core.devices())
            scene = extract_scene(context, settings.geometry)
        except (ValueError, RuntimeError, MemoryError) as error:
            self.report({"ERROR"}, sentence(error))
            return False
        store.start(context.scene, Job(scene, plan, program()), len(plan.variants()))
        return True

    def _finish(self, context: bpy.types.Context) -> set[str]:
        key = store.running.scene
        try:
            study = store.finish()
        except (
            Exception
        ) as error:  # whatever the study raised: the user gets its text, not a traceback
            self.report({"ERROR"}, sentence(error))
            return {"CANCELLED"}
        if store.is_deleted(key):
            self.report({"WARNING"}, "Stopped: the scene that was compared is gone")
            return {"CANCELLED"}
        panel = context.window_manager.bvh_lab
        panel.show(key, [row.name for row in study.result.rows])
        best = summary.fastest(study.result.rows, panel.kind)
        if best is not None:
            panel.select(key, best.name)
            images.show_picture(context, study, best.name)
        self.report(*_verdict(study, panel.kind))
        _redraw(context)
        return {"FINISHED"}


class BVHLAB_OT_stop(bpy.types.Operator):
    bl_idname = "bvhlab.stop"
    bl_label = "Stop"
    bl_description = "Stop the comparison and keep what was measured"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return store.running is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        store.running.job.cancel()
        return {"FINISHED"}


class BVHLAB_OT_sort(bpy.types.Operator):
    bl_idname = "bvhlab.sort"
    bl_label = "Sort Table"
    bl_description = "Sort by this column; click again for the other way round"
    bl_options = {"INTERNAL"}

    column: EnumProperty(items=[(name, name.title(), "", i) for i, name in enumerate(COLUMNS)])

    def execute(self, context: bpy.types.Context) -> set[str]:
        panel = context.window_manager.bvh_lab
        again = panel.sort_column == self.column
        fast_first = self.column in {"SPEED", "RATIO"}
        panel.sort_reverse = not panel.sort_reverse if again else fast_first
        panel.sort_column = self.column
        return {"FINISHED"}


class BVHLAB_OT_set_baseline(bpy.types.Operator):
    bl_idname = "bvhlab.set_baseline"
    bl_label = "Use as Baseline"
    bl_description = "Give all speeds as multiples of this variant's"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(_active(context))

    def execute(self, context: bpy.types.Context) -> set[str]:
        context.window_manager.bvh_lab.baseline = _active(context)
        return {"FINISHED"}


class BVHLAB_OT_show_picture(bpy.types.Operator):
    bl_idname = "bvhlab.show_picture"
    bl_label = "Show Picture"
    bl_description = "Show the picture that this variant rendered in an open Image Editor"
    bl_options = {"REGISTER"}

    view: StringProperty(name="View", description="Camera; empty for the first")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        study, active = store.study_of(context.scene), _active(context)
        if study is None or not active:
            return False
        pictured = any(name == active for name, _ in study.pictures)
        if not pictured and study.pictures:
            cls.poll_message_set("This row has none: pictures are rendered by the exact tests only")
        return pictured

    def execute(self, context: bpy.types.Context) -> set[str]:
        study = store.study_of(context.scene)
        name = images.show_picture(context, study, _active(context), self.view)
        self.report({"INFO"}, f"The picture is image '{name}'")
        return {"FINISHED"}


class BVHLAB_OT_export(bpy.types.Operator):
    bl_idname = "bvhlab.export"
    bl_label = "Export"
    bl_description = "Write the results to a file or folder"
    bl_options = {"REGISTER"}

    format: EnumProperty(
        name="Format",
        items=[
            ("folder", "Report Folder", "Web page, table, CSV, JSON and pictures in one folder", 0),
            ("csv", "CSV", "One line a variant, for spreadsheets", 1),
            ("json", "JSON", "Everything that was measured, every repeat", 2),
            ("txt", "Text", "The table and its explanation as plain text", 3),
        ],
    )
    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return store.study_of(context.scene) is not None

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.filepath = str(self._default_path(context))
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        path = Path(bpy.path.abspath(self.filepath) or self._default_path(context))
        study = store.study_of(context.scene)
        result = study.result
        try:
            if self.format == "folder":
                write_report(result, study.pictures, path)
            else:
                write = {
                    "csv": lambda: rows_csv(result),
                    "json": result.to_json,
                    "txt": lambda: text_report(result),
                }
                write_text_aside(path, write[self.format]())
        except OSError as error:
            self.report({"ERROR"}, f"{path} cannot be written: {error.strerror or error}")
            return {"CANCELLED"}
        self.report({"INFO"}, f"Wrote {path}")
        return {"FINISHED"}

    def _default_path(self, context: bpy.types.Context) -> Path:
        name = bpy.path.clean_name(store.study_of(context.scene).result.subject.name)
        ending = "" if self.format == "folder" else f".{self.format}"
        return preferences.out_folder() / f"bvh_lab_{name}{ending}"


def _active(context: bpy.types.Context) -> str:
    return context.window_manager.bvh_lab.active_name(store.scene_key(context.scene))


def _why_not(context: bpy.types.Context) -> str:
    """Why no comparison can start now; empty where one can."""
    if store.running is not None:
        return "A comparison is running"
    if reason := store.native_reason():
        return reason
    settings = context.scene.bvh_lab
    if not (settings.builders() and settings.branchings()):
        return "Choose at least one builder and one branching factor"
    if not settings.variants():
        return (
            "Choose at least one kind of nodes, one triangle test and one box test under Settings, "
            "Advanced; compressed nodes need the branching factor 8"
        )
    return ""


def _verdict(study: Study, kind: str) -> tuple[set[str], str]:
    result = study.result
    failed = result.failed()
    if failed:
        return {"WARNING"}, f"{len(failed)} of {len(result.rows)} variants failed: see the table"
    if result.cancelled:
        return {"WARNING"}, f"Stopped: {len(result.rows)} variants were begun"
    said = summary.winner(result.rows, kind)
    return {"INFO"}, said[0] if said else "Nothing was hit by any ray"


def _redraw(context: bpy.types.Context) -> None:
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()


CLASSES = (
    BVHLAB_OT_compare,
    BVHLAB_OT_stop,
    BVHLAB_OT_sort,
    BVHLAB_OT_set_baseline,
    BVHLAB_OT_show_picture,
    BVHLAB_OT_export,
)


def register() -> None:
    """Add the operators."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Take them away, and what a running one holds."""
    watch.stop()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
