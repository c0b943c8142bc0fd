#include "ui/scene/scene_view.h"

#include <QHBoxLayout>
#include <QPainter>
#include <QToolButton>
#include <QVBoxLayout>

#include "ui/spreadsheet/overlay.h"

namespace fluorocut::ui {
namespace {

struct KindButton {
    SceneKind kind;
    const char* text;
    const char* tip;
    QColor color;
};

QIcon swatch(const QColor& color) {
    QPixmap pixmap(24, 24);
    pixmap.fill(Qt::transparent);
    QPainter painter(&pixmap);
    painter.setRenderHint(QPainter::Antialiasing);
    painter.setPen(Qt::NoPen);
    painter.setBrush(color);
    painter.drawRoundedRect(QRectF(5, 5, 14, 14), 4, 4);
    return pixmap;
}

QToolButton* flatButton(const QString& text, const QString& tip, QWidget* parent) {
    auto* button = new QToolButton(parent);
    button->setText(text);
    button->setToolTip(tip);
    button->setAutoRaise(true);
    button->setFocusPolicy(Qt::TabFocus);
    return button;
}

}  // namespace

SceneView::SceneView(Session& session, QWidget* parent, SceneBackend backend)
    : QWidget(parent), session_(&session), canvas_(new SceneCanvas(backend, this)) {
    auto* strip = new QHBoxLayout;
    strip->setContentsMargins(4, 2, 4, 2);
    strip->setSpacing(2);
    const KindButton kinds[] = {
        {SceneKind::bone, QT_TR_NOOP("Bone"), QT_TR_NOOP("The bone's outer surface, from the CT"), {233, 222, 196}},
        {SceneKind::implant, QT_TR_NOOP("Implant"), QT_TR_NOOP("The planned implant"), colorOf(Ink::implant)},
        {SceneKind::cavities, QT_TR_NOOP("Cavity"), QT_TR_NOOP("The stages of the cavity"), colorOf(Ink::stage)},
        {SceneKind::views, QT_TR_NOOP("C-arm"), QT_TR_NOOP("The C-arm's positions with their images"), {170, 186, 200}},
        {SceneKind::path, QT_TR_NOOP("Tool path"), QT_TR_NOOP("The way of the cutter's ball"), colorOf(Ink::found)},
        {SceneKind::robot, QT_TR_NOOP("Robot"), QT_TR_NOOP("The cutter, where the robot says it is"), {176, 184, 192}}};
    for (const KindButton& kind : kinds) {
        QToolButton* button = flatButton(tr(kind.text), tr(kind.tip), this);
        button->setIcon(swatch(kind.color));
        button->setToolButtonStyle(Qt::ToolButtonTextBesideIcon);
        button->setCheckable(true);
        button->setChecked(true);
        connect(button, &QToolButton::toggled, this,
                [this, which = kind.kind](bool shown) { canvas_->setShown(which, shown); });
        buttons_[static_cast<std::size_t>(kind.kind)] = button;
        strip->addWidget(button);
    }
    strip->addStretch(1);
    const auto addLook = [&](const QString& text, const QString& tip, auto look) {
        QToolButton* button = flatButton(text, tip, this);
        connect(button, &QToolButton::clicked, canvas_, look);
        strip->addWidget(button);
    };
    addLook(tr("A"), tr("From the front (A)"), [this] { canvas_->lookFrom(LookFrom::anterior); });
    addLook(tr("L"), tr("From the operated side (L)"), [this] { canvas_->lookFromOperatedSide(); });
    addLook(tr("S"), tr("From above (S)"), [this] { canvas_->lookFrom(LookFrom::superior); });
    addLook(tr("Fit"), tr("Bone and plan fit; once more: everything (F)"), [this] { canvas_->fit(); });

    auto* column = new QVBoxLayout(this);
    column->setContentsMargins(0, 0, 0, 0);
    column->setSpacing(0);
    column->addLayout(strip);
    column->addWidget(canvas_, 1);
    setFocusProxy(canvas_);

    connect(&session, &Session::changed, this, &SceneView::follow);
    connect(&jobs_, &JobRunner::progressed, this, [this](double fraction, const QString&) {
        canvas_->setNote(tr("Bone surface from the CT: %1 %").arg(100 * fraction, 0, 'f', 0));
    });
    connect(&jobs_, &JobRunner::crashed, this, [this](const QString& what) {
        builder_.setBone(wanted_, nullptr);
        canvas_->setNote(tr("No bone surface: %1").arg(what));
        emit prepared();
    });
    follow();
}

SceneView::~SceneView() = default;

void SceneView::showEvent(QShowEvent*) {
    follow();
}

void SceneView::follow() {
    if (!session_) return;
    const CaseState& state = *session_->state();
    prepareBone();
    Scene scene = builder_.build(state);
    std::array<bool, kSceneKinds> there{};
    for (const SceneItem& item : scene.items)
        there[static_cast<std::size_t>(item.kind)] = true;
    there[static_cast<std::size_t>(SceneKind::bone)] |= state.ct != nullptr;
    for (std::size_t kind = 0; kind < there.size(); ++kind)
        buttons_[kind]->setEnabled(there[kind]);
    canvas_->setOperatedSide(state.side == "right" ? LookFrom::right : LookFrom::left);
    canvas_->setScene(std::move(scene), session_->isPreviewing());
}

void SceneView::prepareBone() {
    const std::shared_ptr<const Volume> ct = session_->state()->ct;
    if (jobs_.isBusy()) {
        if (ct != wanted_) jobs_.cancel();  // its end begins the next
        return;
    }
    if (!ct || builder_.hasBone(ct) || !isVisible()) return;
    wanted_ = ct;
    canvas_->setNote(tr("Bone surface from the CT"));
    using Surface = std::shared_ptr<const ShadedMesh>;
    jobs_.run<Surface>([ct](Progress& progress) { return boneOf(*ct, progress); },
                       [this, ct](Result<Surface> surface) {
                           canvas_->setNote({});
                           if (surface) {
                               builder_.setBone(ct, *surface);
                               if (!*surface) canvas_->setNote(tr("The CT shows no bone"));
                           } else if (!surface.error().isCancelled()) {
                               builder_.setBone(ct, nullptr);
                               canvas_->setNote(QString::fromStdString(surface.error().message()));
                           }
                           follow();
                           if (!jobs_.isBusy()) emit prepared();
                       });
}

}  // namespace fluorocut::ui
