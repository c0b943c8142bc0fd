// Linked into every program of a sanitizer build: the options that would otherwise stand in the environment. Test
// discovery runs the programs without that environment.
extern "C" {

// Keeps plug-ins loaded, so that the stack of a leak still has names when it is held against the suppressions.
int dlclose(void*) {
    return 0;
}

// Leaks of the drivers and plug-ins behind Qt and OpenGL, none of them ours.
const char* __lsan_default_suppressions() {
    return "leak:libqoffscreen.so\nleak:libqxcb.so\nleak:libfontconfig.so\nleak:swrast_dri.so\nleak:libEGL_mesa.so\n"
           "leak:libGLX_mesa.so\nleak:libdbus-1.so\n";
}
const char* __lsan_default_options() {
    return "print_suppressions=0";
}
const char* __ubsan_default_options() {
    return "print_stacktrace=1:halt_on_error=1";
}
const char* __tsan_default_suppressions() {
    return "race:swrast_dri.so\n";
}

}  // extern "C"
