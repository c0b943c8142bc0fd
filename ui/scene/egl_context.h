// EglContext: desktop OpenGL 3.2 (core) that draws into memory and needs neither a screen nor an X server: EGL's
// surfaceless platform (Mesa: on the graphics card or on the processor), or else EGL's first device.
#pragma once

#include <QString>

namespace fluorocut::ui {

class EglContext {
  public:
    // Fails where EGL or its platform is missing: isValid() is false then and error() says why.
    EglContext();
    ~EglContext();
    EglContext(const EglContext&) = delete;
    EglContext& operator=(const EglContext&) = delete;

    bool isValid() const { return context_ != nullptr; }
    const QString& error() const { return error_; }
    bool makeCurrent();
    bool isCurrent() const;

  private:
    // EGL's handles, which are pointers; its header stays in the .cpp.
    bool open(void* display);

    void* display_ = nullptr;
    void* context_ = nullptr;
    void* surface_ = nullptr;
    QString error_;
};

}  // namespace fluorocut::ui
