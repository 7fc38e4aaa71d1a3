# SPDX-License-Identifier: GPL-3.0-or-later
"""Presses keys as a keyboard does, through the X server.

Blender notes the wish to break off a render where keys come in, which simulated events pass by
(and with --enable-event-simulate no others come in).
"""

from __future__ import annotations

import ctypes
from ctypes import POINTER, byref, c_char_p, c_int, c_long, c_uint, c_ulong, c_void_p

ESCAPE = 0xFF1B  # of keysymdef.h
PRESS, RELEASE = (2, 1 << 0), (3, 1 << 1)  # of X.h: type of event, mask
SIGNATURES = {
    "XOpenDisplay": (c_void_p, [c_char_p]),
    "XDefaultRootWindow": (c_ulong, [c_void_p]),
    "XKeysymToKeycode": (c_uint, [c_void_p, c_ulong]),
    "XSendEvent": (c_int, [c_void_p, c_ulong, c_int, c_long, c_void_p]),
    "XCloseDisplay": (c_int, [c_void_p]),
    "XFree": (c_int, [c_void_p]),
}


class KeyEvent(ctypes.Structure):
    """XKeyEvent of Xlib.h, as long as an XEvent."""

    _fields_ = [
        ("type", c_int),
        ("serial", c_ulong),
        ("send_event", c_int),
        ("display", c_void_p),
        ("window", c_ulong),
        ("root", c_ulong),
        ("subwindow", c_ulong),
        ("time", c_ulong),
        ("x", c_int),
        ("y", c_int),
        ("x_root", c_int),
        ("y_root", c_int),
        ("state", c_uint),
        ("keycode", c_uint),
        ("same_screen", c_int),
        ("padding", c_long * 12),
    ]


def press(key: int) -> None:
    """In every window on the screen; under Xvfb it is Blender's alone."""
    xlib = ctypes.CDLL("libX11.so.6")
    for name, (result, arguments) in SIGNATURES.items():
        function = getattr(xlib, name)
        function.restype, function.argtypes = result, arguments
    display = xlib.XOpenDisplay(None)
    root = xlib.XDefaultRootWindow(display)
    windows, count = POINTER(c_ulong)(), c_uint()
    unused = c_ulong()
    xlib.XQueryTree(
        c_void_p(display), root, byref(unused), byref(unused), byref(windows), byref(count)
    )
    for window in windows[: count.value]:
        for kind, mask in (PRESS, RELEASE):
            event = KeyEvent(type=kind, window=window, root=root, same_screen=1)
            event.keycode = xlib.XKeysymToKeycode(display, key)
            xlib.XSendEvent(display, window, 1, mask, byref(event))
    xlib.XFree(windows)
    xlib.XCloseDisplay(display)
