// ImplantLibrary: the families of stems there are and their sizes, as a list to choose from: what a family is like, and
// what a size measures. Families come from resources/implants (core/io/resources.h).
#pragma once

#include <QWidget>
#include <string>
#include <vector>

#include "core/planning/implant_family.h"

class QLabel;
class QListWidget;
class QPushButton;
class QTableWidget;

namespace fluorocut::ui {

// All families that can be read; one that cannot be is left out of the choice and told by `problems`.
struct ImplantShelf {
    struct Entry {
        std::string name;  // as core/planning finds it
        ImplantFamily family;
    };
    std::vector<Entry> entries;
    QString problems;

    static ImplantShelf read();
    const ImplantFamily* family(const std::string& name) const;
};

class ImplantLibrary final : public QWidget {
    Q_OBJECT

  public:
    explicit ImplantLibrary(const ImplantShelf& shelf, QWidget* parent = nullptr);

    // What is chosen at first.
    void choose(const std::string& family, const std::string& size);

  signals:
    void chosen(const QString& family, const QString& size);

  private:
    void showFamily();
    void take();

    ImplantShelf shelf_;
    QListWidget* families_;
    QLabel* about_;
    QTableWidget* sizes_;
    QPushButton* use_;
};

}  // namespace fluorocut::ui
