#include "ui/scene/egl_context.h"

#define EGL_NO_X11
#include <QCoreApplication>
#include <cstring>

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <dlfcn.h>

// VTK calls glewInit() of the system's GLEW, which is built for X: it loads every function and then fails with
// GLEW_ERROR_NO_GLX_DISPLAY (4), since the context is not X's. This definition, in the executable, is found before
// GLEW's own; it calls that one and forgives just this.
extern "C" __attribute__((visibility("default"))) unsigned int glewInit();
extern "C" unsigned int glewInit() {
    using Function = unsigned int (*)();
    static const auto real = reinterpret_cast<Function>(dlsym(RTLD_NEXT, "glewInit"));
    constexpr unsigned int kFailed = 1, kNoGlxDisplay = 4;
    if (!real) return kFailed;
    const unsigned int answer = real();
    return answer == kNoGlxDisplay ? 0 : answer;
}

namespace fluorocut::ui {
namespace {

bool names(const char* list, const char* extension) {
    return list && std::strstr(list, extension);
}

QString tr(const char* text) {
    return QCoreApplication::translate("SceneRenderer", text);
}

}  // namespace

EglContext::EglContext() {
    const char* extensions = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    const auto platformDisplay =
        reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(eglGetProcAddress("eglGetPlatformDisplayEXT"));
    error_ = tr("EGL has no display without a screen");
    if (!platformDisplay) return;
    if (names(extensions, "EGL_MESA_platform_surfaceless") &&
        open(platformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr))) {
        return;
    }
    const auto queryDevices = reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(eglGetProcAddress("eglQueryDevicesEXT"));
    EGLDeviceEXT device = nullptr;
    EGLint devices = 0;
    if (names(extensions, "EGL_EXT_platform_device") && queryDevices && queryDevices(1, &device, &devices) &&
        devices > 0) {
        open(platformDisplay(EGL_PLATFORM_DEVICE_EXT, device, nullptr));
    }
}

bool EglContext::open(void* display) {
    EGLint major = 0, minor = 0;
    if (display == EGL_NO_DISPLAY || !eglInitialize(display, &major, &minor) || !eglBindAPI(EGL_OPENGL_API)) {
        error_ = tr("EGL's display has no desktop OpenGL");
        return false;
    }
    constexpr EGLint kConfig[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
    EGLConfig config = nullptr;
    EGLint configs = 0;
    if (!eglChooseConfig(display, kConfig, &config, 1, &configs) || configs < 1) {
        error_ = tr("EGL's display has no usable configuration");
        return false;
    }
    constexpr EGLint kContext[] = {
        EGL_CONTEXT_MAJOR_VERSION,           3,       EGL_CONTEXT_MINOR_VERSION, 2, EGL_CONTEXT_OPENGL_PROFILE_MASK,
        EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE};
    display_ = display;
    context_ = eglCreateContext(display, config, EGL_NO_CONTEXT, kContext);
    if (!names(eglQueryString(display, EGL_EXTENSIONS), "EGL_KHR_surfaceless_context")) {
        constexpr EGLint kSurface[] = {EGL_WIDTH, 16, EGL_HEIGHT, 16, EGL_NONE};
        surface_ = eglCreatePbufferSurface(display, config, kSurface);
    }
    if (makeCurrent()) {
        error_.clear();
        return true;
    }
    error_ = tr("EGL gives no OpenGL 3.2");
    if (context_) eglDestroyContext(display, context_);
    context_ = nullptr;
    return false;
}

bool EglContext::makeCurrent() {
    return context_ && eglBindAPI(EGL_OPENGL_API) && eglMakeCurrent(display_, surface_, surface_, context_);
}

bool EglContext::isCurrent() const {
    return context_ && eglGetCurrentContext() == context_;
}

EglContext::~EglContext() {
    if (!context_) return;
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    if (surface_) eglDestroySurface(display_, surface_);
    eglDestroyContext(display_, context_);
    // Never eglTerminate: the display is one for the whole process, and other contexts on it would go blind.
}

}  // namespace fluorocut::ui
