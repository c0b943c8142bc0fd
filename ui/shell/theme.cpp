#include "ui/shell/theme.h"

#include <QApplication>
#include <QFont>
#include <QPalette>
#include <QStyleFactory>

namespace fluorocut::ui {

void applyTheme(QApplication& application) {
    application.setStyle(QStyleFactory::create("Fusion"));
    application.setFont(QFont("DejaVu Sans", 9));

    const QColor window(30, 34, 38);
    const QColor base(20, 23, 26);
    const QColor text(216, 222, 228);
    const QColor quiet(120, 128, 136);
    const QColor accent(70, 130, 180);
    QPalette palette;
    palette.setColor(QPalette::Window, window);
    palette.setColor(QPalette::WindowText, text);
    palette.setColor(QPalette::Base, base);
    palette.setColor(QPalette::AlternateBase, window);
    palette.setColor(QPalette::Text, text);
    palette.setColor(QPalette::Button, QColor(44, 49, 54));
    palette.setColor(QPalette::ButtonText, text);
    palette.setColor(QPalette::BrightText, Qt::white);
    palette.setColor(QPalette::ToolTipBase, base);
    palette.setColor(QPalette::ToolTipText, text);
    palette.setColor(QPalette::PlaceholderText, quiet);
    palette.setColor(QPalette::Highlight, accent);
    palette.setColor(QPalette::HighlightedText, Qt::white);
    palette.setColor(QPalette::Link, accent.lighter(130));
    for (const auto role : {QPalette::WindowText, QPalette::Text, QPalette::ButtonText}) {
        palette.setColor(QPalette::Disabled, role, quiet);
    }
    application.setPalette(palette);
    application.setStyleSheet(
        "QMenuBar { background: #1e2226; } QMenuBar::item { padding: 5px 10px; background: transparent; }"
        "QMenuBar::item:selected { background: #2c3136; }"
        "QStatusBar { background: #1e2226; color: #9aa4ae; } QStatusBar::item { border: none; }");
}

}  // namespace fluorocut::ui
