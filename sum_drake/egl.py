"""Asks EGL whether it can render OpenGL off screen, as RenderEngineVtk will.

Run as a script, in a process of its own: a broken driver may take the process that asks with it. Imports nothing of
the package, so that it also runs where nothing else does. Prints one line, "ok" and the renderer's name or what is
missing.
"""

import ctypes

NO_DISPLAY = None
OPENGL_API = 0x30A2
NONE = 0x3038
CONFIG = (0x3033, 0x0001, 0x3040, 0x0008, 0x3024, 8, 0x3023, 8, 0x3022, 8, 0x3025, 24, NONE)
"""EGL_SURFACE_TYPE pbuffer, EGL_RENDERABLE_TYPE OpenGL, 8 bits red, green and blue, 24 bits depth."""
SURFACE = (0x3057, 16, 0x3056, 16, NONE)
"""EGL_WIDTH, EGL_HEIGHT."""
PLATFORM_DEVICE = 0x313F
GL_RENDERER = 0x1F01


def probe() -> str:
    """ "ok: <renderer>", or what stops EGL from rendering."""
    try:
        ctypes.CDLL("libglib-2.0.so.0")
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError as error:
        return f"a library is missing: {error}"
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    egl.eglGetDisplay.restype = ctypes.c_void_p
    egl.eglGetDisplay.argtypes = [ctypes.c_void_p]
    answer = "EGL finds no driver"
    for display in (*_device_displays(egl), egl.eglGetDisplay(NO_DISPLAY)):
        answer = _try_display(egl, display)
        if answer.startswith("ok"):
            break
    return answer


def _device_displays(egl: ctypes.CDLL) -> list[int | None]:
    """Displays of the devices that EGL names, in their order, which is VTK's."""
    query, display_of = (egl.eglGetProcAddress(name) for name in (b"eglQueryDevicesEXT", b"eglGetPlatformDisplayEXT"))
    if not query or not display_of:
        return []
    query_devices = ctypes.CFUNCTYPE(
        ctypes.c_uint, ctypes.c_int, ctypes.POINTER(ctypes.c_void_p), ctypes.POINTER(ctypes.c_int)
    )(query)
    get_display = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p)(display_of)
    devices, count = (ctypes.c_void_p * 16)(), ctypes.c_int()
    if not query_devices(16, devices, ctypes.byref(count)):
        return []
    return [get_display(PLATFORM_DEVICE, device, None) for device in devices[: count.value]]


def _try_display(egl: ctypes.CDLL, display: int | None) -> str:
    """Makes a context on a display and asks it for its renderer's name."""
    handle = ctypes.c_void_p(display)
    if not display or not egl.eglInitialize(handle, None, None):
        return "EGL finds no driver"
    if not egl.eglBindAPI(OPENGL_API):
        return "EGL's driver has no OpenGL"
    config, count = ctypes.c_void_p(), ctypes.c_int()
    attributes = (ctypes.c_int * len(CONFIG))(*CONFIG)
    if not egl.eglChooseConfig(handle, attributes, ctypes.byref(config), 1, ctypes.byref(count)) or not count.value:
        return "EGL's driver offers no OpenGL surface off screen"
    egl.eglCreateContext.restype = egl.eglCreatePbufferSurface.restype = ctypes.c_void_p
    context = ctypes.c_void_p(egl.eglCreateContext(handle, config, None, None))
    surface = ctypes.c_void_p(egl.eglCreatePbufferSurface(handle, config, (ctypes.c_int * len(SURFACE))(*SURFACE)))
    if not context or not egl.eglMakeCurrent(handle, surface, surface, context):
        return "EGL's driver makes no OpenGL context"
    address = egl.eglGetProcAddress(b"glGetString")
    if not address:
        return "EGL's driver has no OpenGL"
    name = ctypes.CFUNCTYPE(ctypes.c_char_p, ctypes.c_uint)(address)(GL_RENDERER)
    return f"ok: {name.decode(errors='replace')}" if name else "EGL's driver makes no OpenGL context"


if __name__ == "__main__":
    print(probe())
