// A main window with a session, settings and a folder for cases of its own, and a sample case that costs nothing.
#pragma once

#include "tests/support/fixtures.h"
#include "ui/session/session.h"
#include "ui/shell/main_window.h"
#include "ui/shell/settings.h"

namespace fluorocut::test {

class DesktopAtHand {
  public:
    static constexpr const char* kPatient = "the sample";

    explicit DesktopAtHand(const QString& settings = {});

    ScratchFolder scratch_;
    // What the window calls for the sample case, to be replaced before.
    ui::MakeCase sample_;
    ui::Session session_;
    ui::Settings settings_;
    ui::MainWindow window_;

  private:
    static ui::Settings& prepared(ui::Settings& settings, const ScratchFolder& folder);
};

// Two registered views, a box for an implant.
ui::CaseState smallCase();

}  // namespace fluorocut::test
