#include "ui/wizards/wizard.h"

#include <QLabel>
#include <QLineEdit>
#include <QListWidget>
#include <QPushButton>
#include <QSignalSpy>
#include <QTest>
#include <limits>

#include <gtest/gtest.h>

#include "tests/ui/hand.h"
#include "ui/shell/theme.h"

namespace fluorocut::ui {
namespace {

Acceptance good() {
    return {atMost("residual", 0.12, 0.25, "mm")};
}

Acceptance bad() {
    return {atMost("residual", 0.31, 0.25, "mm"), atLeast("coverage", 0.8, 0.3, "")};
}

// Three pages; each one's first action measures what the test says it will find.
class WizardTest : public testing::Test {
  protected:
    WizardTest() : wizard_("Calibrate") {
        for (int i = 0; i < 3; ++i) {
            auto* page = new WizardPage(QString("page%1").arg(i), QString("Page %1").arg(i), "Do this.");
            page->addAction("Measure", [this, page] { page->setAcceptance(finds_); });
            wizard_.addPage(page);
        }
        wizard_.setKeeper([this](const WizardDecision& decision, const std::function<void(Result<void>)>& kept) {
            if (disk_full_) return kept(outputFailed("calibration.fluorocut", "a full disk"));
            decisions_.push_back(decision);
            kept({});
        });
        wizard_.resize(1280, 740);
        wizard_.show();
        // Shortcuts belong to the active window.
        wizard_.activateWindow();
        QApplication::setActiveWindow(&wizard_);
    }
    void click(QPushButton* button) {
        ASSERT_NE(button, nullptr);
        ASSERT_TRUE(button->isVisible());
        QTest::mouseClick(button, Qt::LeftButton);
    }
    void press(int key, Qt::KeyboardModifiers modifiers = {}) {
        QWidget* focus = QApplication::focusWidget();
        QTest::keyClick(focus ? focus : &wizard_, static_cast<Qt::Key>(key), modifiers);
    }

    Wizard wizard_;
    Acceptance finds_ = good();
    std::vector<WizardDecision> decisions_;
    bool disk_full_ = false;
};

TEST_F(WizardTest, NextIsLockedUntilTheMeasurementIsMet) {
    EXPECT_FALSE(wizard_.nextButton()->isEnabled());
    EXPECT_FALSE(wizard_.current().reason().isEmpty());
    click(wizard_.nextButton());
    wizard_.next();
    EXPECT_EQ(wizard_.index(), 0);
    finds_ = bad();
    click(wizard_.current().primaryAction());
    EXPECT_FALSE(wizard_.nextButton()->isEnabled());
    EXPECT_TRUE(wizard_.current().reason().contains("0.31")) << wizard_.current().reason().toStdString();
    finds_ = good();
    click(wizard_.current().primaryAction());
    EXPECT_TRUE(wizard_.nextButton()->isEnabled());
    click(wizard_.nextButton());
    EXPECT_EQ(wizard_.index(), 1);
    ASSERT_EQ(decisions_.size(), 1u);
    EXPECT_TRUE(decisions_[0].by_limits);
    EXPECT_EQ(decisions_[0].page, "page0");
}

TEST_F(WizardTest, AMeasurementThatWasNotMadeLocksIt) {
    finds_ = {atMost("residual", std::numeric_limits<double>::quiet_NaN(), 0.25, "mm")};
    click(wizard_.current().primaryAction());
    EXPECT_FALSE(wizard_.nextButton()->isEnabled());
}

TEST_F(WizardTest, WorkInProgressLocksIt) {
    click(wizard_.current().primaryAction());
    wizard_.current().setWorking("Looking", 0.5);
    EXPECT_FALSE(wizard_.nextButton()->isEnabled());
    EXPECT_EQ(wizard_.current().primaryAction(), nullptr);
    wizard_.current().setIdle();
    EXPECT_TRUE(wizard_.nextButton()->isEnabled());
}

TEST_F(WizardTest, BackLosesNothing) {
    click(wizard_.current().primaryAction());
    click(wizard_.nextButton());
    click(wizard_.current().primaryAction());
    click(wizard_.backButton());
    EXPECT_EQ(wizard_.index(), 0);
    EXPECT_TRUE(wizard_.current().isMet());
    click(wizard_.nextButton());
    EXPECT_TRUE(wizard_.current().isMet());
    EXPECT_TRUE(wizard_.nextButton()->isEnabled());
    // What had been kept already is not kept twice.
    EXPECT_EQ(decisions_.size(), 1u);
}

TEST_F(WizardTest, DoingAPageAgainMakesTheLaterOnesStale) {
    click(wizard_.current().primaryAction());
    click(wizard_.nextButton());
    click(wizard_.current().primaryAction());
    click(wizard_.backButton());
    click(wizard_.current().primaryAction());
    EXPECT_TRUE(wizard_.current().isMet());
    EXPECT_TRUE(wizard_.page(1).isStale());
    click(wizard_.nextButton());
    EXPECT_FALSE(wizard_.nextButton()->isEnabled());
    EXPECT_TRUE(wizard_.current().reason().contains("Page 0"));
    click(wizard_.current().primaryAction());
    EXPECT_TRUE(wizard_.nextButton()->isEnabled());
}

TEST_F(WizardTest, AnOverrideNeedsANameAndAReasonAndIsKept) {
    EXPECT_FALSE(wizard_.overrideButton()->isVisible());  // there is nothing to go on with
    finds_ = bad();
    click(wizard_.current().primaryAction());
    click(wizard_.overrideButton());
    EXPECT_FALSE(wizard_.confirmOverride()->isEnabled());
    QTest::keyClicks(wizard_.nameField(), "M. Curie");
    EXPECT_FALSE(wizard_.confirmOverride()->isEnabled());
    QTest::keyClicks(wizard_.reasonField(), "   ");
    EXPECT_FALSE(wizard_.confirmOverride()->isEnabled());
    QTest::keyClicks(wizard_.reasonField(), "phantom only");
    click(wizard_.confirmOverride());
    EXPECT_FALSE(wizard_.nameField()->isVisible());
    click(wizard_.nextButton());
    EXPECT_EQ(wizard_.index(), 1);
    ASSERT_EQ(decisions_.size(), 1u);
    EXPECT_FALSE(decisions_[0].by_limits);
    EXPECT_EQ(decisions_[0].who, "M. Curie");
    EXPECT_EQ(decisions_[0].why, "phantom only");
    EXPECT_FALSE(accepted(decisions_[0].acceptance));
    // A new measurement is judged anew.
    click(wizard_.backButton());
    click(wizard_.current().primaryAction());
    EXPECT_FALSE(wizard_.nextButton()->isEnabled());
}

TEST_F(WizardTest, WhatCannotBeKeptHoldsTheWayAndSaysWhy) {
    disk_full_ = true;
    click(wizard_.current().primaryAction());
    click(wizard_.nextButton());
    EXPECT_EQ(wizard_.index(), 0);
    bool said = false;
    for (const QLabel* label : wizard_.findChildren<QLabel*>())
        said = said || (label->isVisible() && label->text().contains("a full disk"));
    EXPECT_TRUE(said);
    disk_full_ = false;
    click(wizard_.nextButton());
    EXPECT_EQ(wizard_.index(), 1);
}

TEST_F(WizardTest, GoesByTheKeyboardAlone) {
    QSignalSpy finished(&wizard_, &Wizard::finished);
    press(Qt::Key_Return);  // measures
    EXPECT_TRUE(wizard_.current().isMet());
    press(Qt::Key_Right, Qt::AltModifier);
    EXPECT_EQ(wizard_.index(), 1);
    finds_ = bad();
    press(Qt::Key_Return);
    ASSERT_TRUE(wizard_.current().mayBeOverridden());
    press(Qt::Key_O, Qt::AltModifier);
    // A mnemonic's button stays down for a moment.
    ASSERT_TRUE(QTest::qWaitFor([this] { return QApplication::focusWidget() == wizard_.nameField(); }));
    QTest::keyClicks(QApplication::focusWidget(), "M. Curie");
    press(Qt::Key_Tab);
    QTest::keyClicks(QApplication::focusWidget(), "phantom only");
    press(Qt::Key_Return);
    EXPECT_TRUE(wizard_.current().mayGoOn());
    press(Qt::Key_Return);  // Next has the focus
    EXPECT_EQ(wizard_.index(), 2);
    press(Qt::Key_Left, Qt::AltModifier);
    EXPECT_EQ(wizard_.index(), 1);
    press(Qt::Key_Return);
    finds_ = good();
    press(Qt::Key_Return);
    press(Qt::Key_Right, Qt::AltModifier);
    EXPECT_EQ(finished.count(), 1);
    EXPECT_EQ(decisions_.size(), 3u);
}

TEST_F(WizardTest, TheListLeadsBackButNotPastWhatIsLocked) {
    auto* steps = wizard_.findChild<QListWidget*>("wizardSteps");
    ASSERT_NE(steps, nullptr);
    steps->setCurrentRow(2);
    EXPECT_EQ(wizard_.index(), 0);
    EXPECT_EQ(steps->currentRow(), 0);
    click(wizard_.current().primaryAction());
    click(wizard_.nextButton());
    steps->setCurrentRow(0);
    EXPECT_EQ(wizard_.index(), 0);
}

TEST_F(WizardTest, LightsSayInWordsWhatTheirColourSays) {
    EXPECT_EQ(rowOf(atMost("residual", 0.2, 0.25, "mm")).light, Light::met);
    const CheckRow over = rowOf(atMost("residual", 0.31, 0.25, "mm"));
    EXPECT_EQ(over.light, Light::failed);
    EXPECT_EQ(over.value, "0.31 mm");
    EXPECT_EQ(over.limit, "at most 0.25 mm");
    EXPECT_TRUE(over.reason.contains("over the limit"));
    EXPECT_EQ(rowOf(atLeast("share", std::numeric_limits<double>::quiet_NaN(), 0.6, "")).light, Light::unknown);
    EXPECT_NE(wordOf(Light::met), wordOf(Light::failed));
}

TEST_F(WizardTest, FitsTheSmallestScreenInEveryLook) {
    auto* application = qobject_cast<QApplication*>(QApplication::instance());
    for (const Look look : {Look::dark, Look::light, Look::operatingRoom}) {
        applyTheme(*application, look);
        Wizard wizard("Calibrate the imager");
        auto* page = new WizardPage("plate", "Grooved plate", "Put the plate on the detector, its grooves inward.");
        page->addAction("Take the picture", [] {});
        page->setAcceptance(bad(), "Clean the plate and take another picture.");
        wizard.addPage(page);
        wizard.show();
        const QSize least = wizard.minimumSizeHint();
        EXPECT_LE(least.width(), 1280) << static_cast<int>(look);
        // Title bar, menu and status bar take 80 of 800 (OR: 60 of them are the menu's).
        EXPECT_LE(least.height(), 640) << static_cast<int>(look);
    }
    applyTheme(*application, Look::dark);
}

}  // namespace
}  // namespace fluorocut::ui
