// What the desktop shows: image files, or simulated views of the built-in femur.
#pragma once

#include <QStringList>

#include "ui/shell/main_window.h"

namespace fluorocut::desktop {

// A job that reads the files.
ui::MakeImages imagesOf(const QStringList& files);

// A job that generates the built-in femur and takes an AP and a lateral picture of it.
ui::MakeImages femurViews();

}  // namespace fluorocut::desktop
