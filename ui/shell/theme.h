// The look of the desktop: dark, so that images are the brightest thing on the screen.
#pragma once

class QApplication;

namespace fluorocut::ui {

void applyTheme(QApplication& application);

}  // namespace fluorocut::ui
