#include "ui/shell/theme.h"

#include <QApplication>
#include <QFont>
#include <QFontMetrics>
#include <QPalette>
#include <QScreen>
#include <QStyleFactory>
#include <algorithm>
#include <cmath>

namespace fluorocut::ui {
namespace {

struct Shades {
    QColor window, base, button, text, quiet, accent, on_accent, line;
};

Shades shadesOf(Look look) {
    if (look == Look::light) {
        return {QColor(0xf2f4f6), QColor(0xffffff), QColor(0xe3e7ea), QColor(0x1b2126),
                QColor(0x5d6770), QColor(0x1f6fb2), QColor(0xffffff), QColor(0xc5ccd2)};
    }
    return {QColor(0x1e2226), QColor(0x14171a), QColor(0x2c3136), QColor(0xd8dee4),
            QColor(0x8f99a3), QColor(0x4682b4), QColor(0xffffff), QColor(0x3a4147)};
}

QPalette paletteOf(const Shades& shades) {
    QPalette palette;
    palette.setColor(QPalette::Window, shades.window);
    palette.setColor(QPalette::WindowText, shades.text);
    palette.setColor(QPalette::Base, shades.base);
    palette.setColor(QPalette::AlternateBase, shades.window);
    palette.setColor(QPalette::Text, shades.text);
    palette.setColor(QPalette::Button, shades.button);
    palette.setColor(QPalette::ButtonText, shades.text);
    palette.setColor(QPalette::BrightText, shades.on_accent);
    palette.setColor(QPalette::ToolTipBase, shades.base);
    palette.setColor(QPalette::ToolTipText, shades.text);
    palette.setColor(QPalette::PlaceholderText, shades.quiet);
    palette.setColor(QPalette::Highlight, shades.accent);
    palette.setColor(QPalette::HighlightedText, shades.on_accent);
    palette.setColor(QPalette::Link, shades.window.lightness() < 128 ? shades.accent.lighter(140) : shades.accent);
    palette.setColor(QPalette::Mid, shades.line);
    for (const auto role : {QPalette::WindowText, QPalette::Text, QPalette::ButtonText})
        palette.setColor(QPalette::Disabled, role, shades.quiet);
    return palette;
}

QString styleOf(const Shades& shades, int target) {
    // What can be pressed is at least `target` high; 0: as the style has it.
    const QString height = target > 0 ? QString("min-height: %1px;").arg(target) : QString();
    const QString width = target > 0 ? QString("min-width: %1px;").arg(target) : QString();
    // An item of a menu knows no least height: it is made of a line and what is around it.
    const int line = QFontMetrics(QApplication::font()).height();
    const QString around = target > 0 ? QString("padding: %1px 16px;").arg((target - line + 1) / 2) : QString();
    return QString(
               "QMenuBar { background: %1; } QMenuBar::item { padding: 5px 10px; background: transparent; }"
               "QMenuBar::item:selected { background: %2; }"
               "QStatusBar { background: %1; color: %3; } QStatusBar::item { border: none; }"
               "QToolTip { background: %4; color: %5; border: 1px solid %6; padding: 3px; }"
               "QMainWindow::separator { background: %6; width: 3px; height: 3px; }"
               "QMainWindow::separator:hover { background: %7; }"
               "QDockWidget::title { background: %2; padding: 5px 8px; }"
               "QPushButton[primary=\"true\"] { background: %7; color: %8; border: none; border-radius: 4px;"
               " padding: 8px 18px; font-weight: bold; }"
               "QPushButton[primary=\"true\"]:hover { background: %9; }")
               .arg(shades.window.name(), shades.button.name(), shades.quiet.name(), shades.base.name(),
                    shades.text.name(), shades.line.name(), shades.accent.name(), shades.on_accent.name(),
                    shades.accent.lighter(112).name()) +
           QString(
               "QPushButton { padding: 5px 12px; } QPushButton[primary=\"true\"] { padding: 8px 18px; }"
               "QPushButton, QComboBox, QSpinBox, QDoubleSpinBox, QLineEdit, QCheckBox { %1 }"
               "QToolButton { %1 %2 } QMenuBar::item, QMenu::item { %3 } QTabBar::tab { %1 }")
               .arg(height, width, around);
}

}  // namespace

int targetPixels(Look look) {
    if (look != Look::operatingRoom) return 0;
    const QScreen* screen = QApplication::primaryScreen();
    double dots_per_inch = screen ? screen->physicalDotsPerInch() : 96;
    // Screens that do not know their size say anything.
    if (!(dots_per_inch >= 60 && dots_per_inch <= 600)) dots_per_inch = 96;
    return static_cast<int>(std::ceil(kOperatingRoomTargetMm / 25.4 * dots_per_inch));
}

void applyTheme(QApplication& application, Look look) {
    const Shades shades = shadesOf(look);
    application.setStyle(QStyleFactory::create("Fusion"));
    application.setFont(QFont("DejaVu Sans", look == Look::operatingRoom ? kOperatingRoomPoints : 9));
    QApplication::setFont(application.font(), "QDockWidgetTitle");
    application.setPalette(paletteOf(shades));
    application.setStyleSheet(styleOf(shades, targetPixels(look)));
}

}  // namespace fluorocut::ui
