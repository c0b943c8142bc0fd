// CheckList: rows of what was looked at, each with a light (an icon and a word, never a colour alone), a number, the
// limit it is held against, and the reason when it is not good.
#pragma once

#include <QString>
#include <QWidget>
#include <vector>

#include "core/base/acceptance.h"

class QGridLayout;

namespace fluorocut::ui {

enum class Light { unknown, working, met, doubtful, failed };

// "met", "not met", ...
QString wordOf(Light light);

struct CheckRow {
    QString what;        // "grooves found"
    QString value;       // "1302 of 1340"; empty: there is none
    QString limit = {};  // "at least 0.6"
    Light light = Light::unknown;
    QString reason = {};  // a sentence, when the light is not `met`

    friend bool operator==(const CheckRow&, const CheckRow&) = default;
};

CheckRow rowOf(const Judgement& judgement);

// The icon alone, in the navigator's shapes and colours.
class LightIcon : public QWidget {
    Q_OBJECT

  public:
    explicit LightIcon(QWidget* parent = nullptr);

    void setLight(Light light);
    Light light() const { return light_; }

    QSize sizeHint() const override;

  protected:
    void paintEvent(QPaintEvent* event) override;

  private:
    Light light_ = Light::unknown;
};

class CheckList : public QWidget {
    Q_OBJECT

  public:
    explicit CheckList(QWidget* parent = nullptr);

    void setRows(const std::vector<CheckRow>& rows);
    const std::vector<CheckRow>& rows() const { return rows_; }

  private:
    std::vector<CheckRow> rows_;
    QGridLayout* grid_;
};

}  // namespace fluorocut::ui
