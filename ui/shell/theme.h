// The look of the desktop: dark, so that images are the brightest thing on the screen; light, for bright rooms and
// paper; the operating room's, which is dark, can be read from 2 m (18 pt) and used with a gloved finger (20 mm).
#pragma once

#include <QString>

class QApplication;

namespace fluorocut::ui {

enum class Look { dark, light, operatingRoom };

inline constexpr int kOperatingRoomPoints = 18;
inline constexpr double kOperatingRoomTargetMm = 20;

void applyTheme(QApplication& application, Look look = Look::dark);

// The least height of what can be pressed, on the primary screen.
int targetPixels(Look look);

}  // namespace fluorocut::ui
