#include "app/desktop/images.h"

#include <QCoreApplication>
#include <QFileInfo>
#include <utility>

#include "core/imaging/display_picture.h"
#include "core/imaging/standard_views.h"
#include "core/imaging/volume_projector.h"
#include "core/imaging/xray_physics.h"
#include "core/io/image_file.h"
#include "core/simulation/femur_phantom.h"

namespace fluorocut::desktop {
namespace {

// As a C-arm's monitor shows it.
Result<Image> pictureOf(const VolumeProjector& femur, StandardView view) {
    const CArm carm = standardCArm();
    // The femur's origin lies in its shaft at the lesser trochanter: the hip fills the picture.
    const Rigid3 imager_from_femur = standardView(view, Vector3::Zero(), kStandardObjectDepthMm);
    XrayOptions xray;
    xray.object_depth_mm = kStandardObjectDepthMm;
    xray.bits = 16;
    xray.seed = view == StandardView::ap ? 1 : 2;
    const Result<Exposure> exposure = expose(femur.project(carm, imager_from_femur), carm, xray);
    if (!exposure) return exposure.error();
    return displayPicture(exposure->image);
}

QString tr(const char* text) {
    return QCoreApplication::translate("fluorocut::desktop", text);
}

}  // namespace

ui::MakeImages imagesOf(const QStringList& files) {
    return [files](Progress& progress) -> Result<std::vector<ui::TitledImage>> {
        std::vector<ui::TitledImage> images;
        for (const QString& file : files) {
            progress.report(static_cast<double>(images.size()) / files.size(), file.toStdString());
            if (progress.isCancelled()) return cancelled("reading images");
            Result<ImageFile> read = readImage(file.toStdString());
            if (!read) return read.error();
            images.push_back({QFileInfo(file).fileName(), std::make_shared<const Image>(std::move(read->image))});
        }
        return images;
    };
}

ui::MakeImages femurViews() {
    return [](Progress& progress) -> Result<std::vector<ui::TitledImage>> {
        SubProgress generating(progress, 0, 0.85);
        Result<FemurPhantom> femur = generateFemur({}, generating);
        if (!femur) return femur.error();
        progress.report(0.85, "preparing the projections");
        const Result<VolumeProjector> projector =
            VolumeProjector::prepare(std::make_shared<const Volume>(std::move(femur->ct)));
        if (!projector) return projector.error();

        std::vector<ui::TitledImage> images;
        for (const auto& [view, title] : {std::pair{StandardView::ap, "AP"}, {StandardView::lateral, "Lateral"}}) {
            progress.report(0.9, "taking the pictures");
            if (progress.isCancelled()) return cancelled("simulated views");
            Result<Image> picture = pictureOf(*projector, view);
            if (!picture) return picture.error();
            images.push_back({tr(title), std::make_shared<const Image>(std::move(*picture))});
        }
        return images;
    };
}

}  // namespace fluorocut::desktop
