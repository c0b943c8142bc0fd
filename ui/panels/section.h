// Section: a titled part of an inspector, with a line for its state ("out of date", why something is not there).
#pragma once

#include <QWidget>

class QLabel;
class QVBoxLayout;

namespace fluorocut::ui {

enum class Tone { plain, quiet, warning };

// Text that wraps, in the palette's colours; empty text takes no room.
void setText(QLabel& label, const QString& text, Tone tone);

class Section : public QWidget {
    Q_OBJECT

  public:
    explicit Section(const QString& title, QWidget* parent = nullptr);

    QVBoxLayout* body() const { return body_; }
    void setState(const QString& text, Tone tone = Tone::quiet);
    QString stateText() const;

  private:
    QVBoxLayout* body_;
    QLabel* state_;
};

}  // namespace fluorocut::ui
