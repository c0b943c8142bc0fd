// A monkey at the desktop: random mouse, wheel, key and resize events at random widgets, seeded. Nothing may crash, no
// event may take for ever, and afterwards the window still opens the sample case.
#include <QAbstractButton>
#include <QApplication>
#include <QDialog>
#include <QElapsedTimer>
#include <QFileDialog>
#include <QMenu>
#include <QPointer>
#include <QSignalSpy>
#include <QTest>
#include <QTimer>
#include <array>

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "tests/ui/hand.h"
#include "tests/ui/shell/desktop_at_hand.h"
#include "ui/session/autosave.h"
#include "ui/shell/settings.h"

namespace fluorocut::ui {
namespace {

class Monkey {
  public:
    Monkey(MainWindow& window, std::uint64_t seed) : window_(window), random_(seed) {}

    void act() {
        closeWhatBlocks();
        switch (pick(12)) {
            case 0:
            case 1:
            case 2:
                return press(QEvent::MouseButtonPress);
            case 3:
                return release();
            case 4:
            case 5:
            case 6:
                return move();
            case 7:
                return wheel();
            case 8:
            case 9:
                return key();
            case 10:
                return press(QEvent::MouseButtonDblClick);
            default:
                if (pick(40) == 0) window_.resize(400 + pick(1200), 300 + pick(800));
        }
    }

    // Another file dialog, menu or box would be in the monkey's way, as the real ones are: it presses Escape.
    static void closeWhatBlocks() {
        if (QWidget* popup = QApplication::activePopupWidget()) popup->close();
        if (QWidget* modal = QApplication::activeModalWidget()) modal->close();
    }

  private:
    int pick(int below) { return static_cast<int>(random_.uniform(0, below)); }

    QWidget* somewhere() {
        if (held_) return held_;
        const QList<QWidget*> tops = QApplication::topLevelWidgets();
        QWidget* top = pick(5) == 0 ? tops.at(pick(static_cast<int>(tops.size()))) : &window_;
        if (!top->isVisible()) top = &window_;
        at_ = QPoint(pick(std::max(1, top->width())), pick(std::max(1, top->height())));
        QWidget* child = top->childAt(at_);
        return child ? child : top;
    }
    QPointF placeIn(const QWidget& widget) {
        return QPointF(random_.uniform(-5, widget.width() + 5), random_.uniform(-5, widget.height() + 5));
    }
    Qt::KeyboardModifiers modifiers() {
        static constexpr std::array<Qt::KeyboardModifier, 4> kSome{Qt::NoModifier, Qt::NoModifier, Qt::ShiftModifier,
                                                                   Qt::ControlModifier};
        return kSome.at(static_cast<std::size_t>(pick(4)));
    }

    void press(QEvent::Type type) {
        if (held_) return release();
        static constexpr std::array kButtons{Qt::LeftButton, Qt::LeftButton, Qt::MiddleButton, Qt::RightButton};
        QWidget* widget = somewhere();
        button_ = kButtons.at(static_cast<std::size_t>(pick(4)));
        held_ = widget;
        modifiers_ = modifiers();
        test::sendMouse(*widget, type, placeIn(*widget), button_, button_, modifiers_);
    }
    void move() {
        QWidget* widget = somewhere();
        test::sendMouse(*widget, QEvent::MouseMove, placeIn(*widget), Qt::NoButton, held_ ? button_ : Qt::NoButton,
                        held_ ? modifiers_ : modifiers());
    }
    void release() {
        if (!held_) return;
        QWidget* widget = held_;
        held_ = nullptr;
        test::sendMouse(*widget, QEvent::MouseButtonRelease, placeIn(*widget), button_, Qt::NoButton, modifiers_);
    }
    void wheel() {
        QWidget* widget = somewhere();
        test::turnWheel(*widget, placeIn(*widget), pick(7) - 3);
    }
    void key() {
        // Not those that quit, or open the desktop's own file dialog over and over.
        static constexpr std::array kKeys{Qt::Key_F,        Qt::Key_R,     Qt::Key_I,      Qt::Key_M,    Qt::Key_S,
                                          Qt::Key_1,        Qt::Key_2,     Qt::Key_3,      Qt::Key_Left, Qt::Key_Right,
                                          Qt::Key_Up,       Qt::Key_Down,  Qt::Key_PageUp, Qt::Key_Tab,  Qt::Key_Escape,
                                          Qt::Key_PageDown, Qt::Key_Space, Qt::Key_Return, Qt::Key_Z,    Qt::Key_Delete,
                                          Qt::Key_F1,       Qt::Key_Home,  Qt::Key_End,    Qt::Key_Comma};
        QWidget* widget = QApplication::focusWidget();
        if (!widget) widget = &window_;
        QTest::keyClick(widget, kKeys.at(static_cast<std::size_t>(pick(static_cast<int>(kKeys.size())))), modifiers());
    }

    MainWindow& window_;
    Random random_;
    QPoint at_;
    QPointer<QWidget> held_;
    Qt::MouseButton button_ = Qt::NoButton;
    Qt::KeyboardModifiers modifiers_;
};

void letLoose(int events, std::uint64_t seed) {
    test::DesktopAtHand desktop;
    QSignalSpy opened(&desktop.window_, &MainWindow::opened);
    desktop.window_.openSample();
    ASSERT_TRUE(opened.wait(10000));
    Monkey monkey(desktop.window_, seed);
    // A menu or dialog with an event loop of its own gives nothing back until somebody closes it.
    QTimer closing;
    QObject::connect(&closing, &QTimer::timeout, &Monkey::closeWhatBlocks);
    closing.start(10);
    qint64 longest_ms = 0;
    QElapsedTimer timer;
    for (int i = 0; i < events; ++i) {
        timer.start();
        monkey.act();
        if (i % 20 == 0) QApplication::processEvents();
        if (i % 100 == 0) QApplication::sendPostedEvents(nullptr, QEvent::DeferredDelete);
        longest_ms = std::max(longest_ms, timer.elapsed());
        if (!desktop.window_.isVisible()) desktop.window_.show();
    }
    std::printf("%d events, the longest took %lld ms; %s to undo\n", events, static_cast<long long>(longest_ms),
                desktop.session_.canUndo() ? "something" : "nothing");
    EXPECT_LT(longest_ms, 5000);
    for (QWidget* top : QApplication::topLevelWidgets())
        if (top != &desktop.window_) top->close();
    opened.clear();
    desktop.window_.openSample();
    ASSERT_TRUE(opened.wait(10000));
    EXPECT_EQ(desktop.session_.state()->views.size(), 2u);
}

TEST(Monkey, TwoThousandEventsDoNoHarm) {
    letLoose(2000, 7);
}

TEST(Monkey, SlowAHundredThousandEventsDoNoHarm) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed)
        letLoose(10000, seed);
}

}  // namespace
}  // namespace fluorocut::ui
