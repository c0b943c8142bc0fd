// What the surgeon sees while dragging the implant: a sheet of six views of 512 x 512, moved step by step as a hand
// does. Prints a Markdown table.
//
//     spreadsheet_benchmark [steps]
//
// A step is a preview of the session, all overlays worked out anew and every visible cell painted into a picture (the
// offscreen platform: nothing is left to a graphics card). "Pictures" are predicted images that came to the screen
// during those steps; the hand moves 60 times a second there. Processor time counts all threads.
#include <QApplication>
#include <QElapsedTimer>
#include <QImage>
#include <cstdlib>
#include <ctime>

#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/parallel.h"
#include "core/base/stopwatch.h"
#include "tests/ui/sample_case.h"
#include "ui/shell/theme.h"
#include "ui/spreadsheet/sheet.h"

using namespace fluorocut;
using namespace fluorocut::ui;

namespace {

void settle(Sheet& sheet, int least_ms) {
    QElapsedTimer time;
    time.start();
    while (time.elapsed() < least_ms || (!sheet.engine().isIdle() && time.elapsed() < 60000))
        QApplication::processEvents(QEventLoop::AllEvents, 5);
}

CaseState movedTo(CaseState state, int step) {
    state.plan.femur_from_implant = Rigid3::fromTranslation({4 * std::sin(0.07 * step), 3 * std::cos(0.05 * step), 0}) *
                                    Rigid3::fromRotationVector({0, 0, 0.1 * std::sin(0.03 * step)});
    return state;
}

}  // namespace

int main(int argc, char** argv) {
    if (qEnvironmentVariableIsEmpty("QT_QPA_PLATFORM")) qputenv("QT_QPA_PLATFORM", "offscreen");
    QApplication application(argc, argv);
    applyTheme(application);
    const int steps = argc > 1 ? std::atoi(argv[1]) : 120;
    if (steps < 10) {
        fmt::print(stderr, "usage: spreadsheet_benchmark [steps, at least 10]\n");
        return 2;
    }
    Session session;
    Sheet sheet(session);
    sheet.resize(1600, 1060);
    sheet.show();
    session.open(test::sampleCase(6));
    fmt::print("Six views of 512 x 512, stem of {} triangles and {} stages, CT of {} voxels, {} threads\n\n",
               session.state()->plan.mesh->triangles.size(), session.state()->plan.cavities.size(),
               session.state()->ct->grid().voxelCount(), parallelThreads());
    fmt::print("| | ms (median) | processor ms | per second |\n|---|---:|---:|---:|\n");

    // One column, as six cells on the screen.
    sheet.setColumns({{.id = "plan", .kind = "plan", .overlays = {kOverlayKinds.begin(), kOverlayKinds.end()}}});
    settle(sheet, 1000);
    QImage screen(sheet.size(), QImage::Format_RGB32);
    std::vector<double> ms, processor_ms;
    for (int step = 0; step < steps; ++step) {
        const std::clock_t busy = std::clock();
        const Stopwatch stopwatch;
        session.preview(movedTo(*session.committed(), step));
        for (ImageView* cell : sheet.cells())
            static_cast<QWidget*>(cell)->render(&screen, cell->mapTo(&sheet, QPoint()), {}, QWidget::DrawChildren);
        ms.push_back(stopwatch.ms());
        processor_ms.push_back(1e3 * static_cast<double>(std::clock() - busy) / CLOCKS_PER_SEC);
    }
    fmt::print("| overlays of six views, worked out and painted | {:.2f} | {:.2f} | {:.0f} frames |\n", median(ms),
               median(processor_ms), 1e3 / median(ms));
    session.dropPreview();

    for (const bool with_ct : {false, true}) {
        CaseState state = *session.committed();
        if (!with_ct) state.ct.reset();
        session.open(with_ct ? test::sampleCase(6) : state);
        sheet.setColumns({{.id = "predicted", .kind = "predicted", .overlays = {OverlayKind::implant}}});
        settle(sheet, 500);
        int pictures = 0;
        const auto counting = QObject::connect(&sheet.engine(), &CellEngine::changed, [&](const CellKey& key) {
            static std::map<CellKey, SharedImage> latest;
            const SharedImage image = sheet.engine().picture(key).image;
            if (image && latest[key] != image) ++pictures;
            latest[key] = image;
        });
        const std::clock_t busy = std::clock();
        QElapsedTimer time;
        time.start();
        for (int step = 0; step < steps; ++step) {
            session.preview(movedTo(*session.committed(), step));
            while (time.elapsed() < (step + 1) * 1000 / 60)
                QApplication::processEvents(QEventLoop::AllEvents, 2);
        }
        const double seconds = 1e-3 * static_cast<double>(time.elapsed());
        const double busy_ms = 1e3 * static_cast<double>(std::clock() - busy) / CLOCKS_PER_SEC;
        QObject::disconnect(counting);
        fmt::print("| predicted images {} CT while dragging | {:.1f} | {:.1f} | {:.1f} pictures |\n",
                   with_ct ? "with" : "without", 1e3 * seconds / std::max(1, pictures), busy_ms / std::max(1, pictures),
                   pictures / seconds);
        session.dropPreview();
    }
    return 0;
}
