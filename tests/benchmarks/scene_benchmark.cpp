// Frames a second of the 3D view while an implant is moved in it: OpenGL beside the renderer on the CPU, in one run.
// Prints a Markdown table.
//
//     scene_benchmark [rounds]
//
// The scene is of about 200,000 triangles: a translucent bone, an implant, three nested cavities, two C-arm images.
// Every frame moves the implant and its cavities, as a preview does, and turns the camera. Processor time, of all
// threads together, is what to look at on a machine that does other things too.
#include <QGuiApplication>
#include <cstdlib>
#include <ctime>

#include <fmt/format.h>

#include "core/base/median.h"
#include "core/base/stopwatch.h"
#include "core/geometry/mesh_tools.h"
#include "core/geometry/primitives.h"
#include "core/imaging/standard_views.h"
#include "ui/scene/scene_content.h"
#include "ui/scene/scene_renderer.h"

using namespace fluorocut;
using namespace fluorocut::ui;

namespace {

CaseState benchmarkCase() {
    CaseState state;
    state.ct = std::make_shared<const Volume>();  // whose surface is given below
    StemShape stem;
    stem.sections = 80;
    stem.segments = 96;
    for (const double wider_mm : {0.0, 1.0, 2.0, 3.0}) {
        stem.tip_width_mm += Vector2::Constant(wider_mm);
        const auto mesh = std::make_shared<const TriangleMesh>(makeStem(stem));
        if (wider_mm == 0)
            state.plan.mesh = mesh;
        else
            state.plan.cavities.push_back(mesh);
    }
    for (const StandardView side : {StandardView::ap, StandardView::lateral}) {
        CaseView view;
        view.carm = standardCArm();
        view.before.image = std::make_shared<const Image>(view.carm.columns, view.carm.rows, 100.0F);
        view.before.imager_from_femur =
            Pose{Frame::imager, Frame::femur, standardView(side, {0, 0, 0}, kStandardObjectDepthMm), std::nullopt};
        state.views.push_back(view);
    }
    return state;
}

// As large and as finely divided as a femur's shaft with its head.
std::shared_ptr<const ShadedMesh> benchmarkBone() {
    std::vector<LoftSection> shaft;
    for (int i = 0; i <= 300; ++i)
        shaft.push_back({-200.0 + i, {0, 0}, Vector2::Constant(16 + 4 * std::sin(0.05 * i)), 2});
    const TriangleMesh head = transformed(makeSphere(24, 5), Rigid3::fromTranslation({-40, 0, 90}));
    return std::make_shared<const ShadedMesh>(shadedMesh(merged(makeLoft(shaft, 200), head), 3));
}

struct Times {
    double first_ms, ms, processor_ms;
};

Times timesOf(SceneRenderer& renderer, int rounds, const QSize& size) {
    CaseState state = benchmarkCase();
    SceneBuilder builder;
    builder.setBone(state.ct, benchmarkBone());
    SceneCamera camera;
    const auto frame = [&](int i) {
        state.plan.femur_from_implant = Rigid3::fromTranslation({0.1 * i, 0, 0});
        const Scene scene = builder.build(state);
        if (i == 0) camera.fit(ballAround(scene.items), size);
        camera.azimuth_rad += 0.02;
        if (renderer.render(scene.items, camera, size).size() != size) std::exit(1);
    };
    const Stopwatch first;
    frame(0);
    Times times{first.ms(), 0, 0};
    std::vector<double> ms, processor_ms;
    for (int i = 1; i <= rounds; ++i) {
        const std::clock_t busy = std::clock();
        const Stopwatch stopwatch;
        frame(i);
        ms.push_back(stopwatch.ms());
        processor_ms.push_back(1e3 * static_cast<double>(std::clock() - busy) / CLOCKS_PER_SEC);
    }
    times.ms = median(ms);
    times.processor_ms = median(processor_ms);
    return times;
}

}  // namespace

int main(int argc, char** argv) {
    const int rounds = argc > 1 ? std::atoi(argv[1]) : 60;
    if (rounds < 1) {
        fmt::print(stderr, "usage: scene_benchmark [rounds]\n");
        return 2;
    }
    qputenv("QT_QPA_PLATFORM", "offscreen");
    const QGuiApplication application(argc, argv);
    CaseState state = benchmarkCase();
    SceneBuilder builder;
    builder.setBone(state.ct, benchmarkBone());
    std::size_t triangles = 0;
    for (const SceneItem& item : builder.build(state).items)
        if (item.surface) triangles += item.surface->triangles.size();

    const QSize size(900, 600);
    fmt::print("{} triangles, {} x {} pixels, {} frames each\n\n", triangles, size.width(), size.height(), rounds);
    fmt::print("| | first frame ms | ms (median) | frames/s | processor ms | times OpenGL |\n");
    fmt::print("|---|---:|---:|---:|---:|---:|\n");
    double opengl_ms = 0;
    for (const SceneBackend backend : {SceneBackend::openGL, SceneBackend::cpu}) {
        const ChosenRenderer chosen = makeSceneRenderer(backend);
        const char* name = backend == SceneBackend::cpu ? "CPU" : "OpenGL (EGL)";
        if (!chosen.renderer) {
            fmt::print("| {} | there is none: {} |\n", name, chosen.why_no_opengl.toStdString());
            continue;
        }
        const Times times = timesOf(*chosen.renderer, rounds, size);
        if (backend == SceneBackend::openGL) opengl_ms = times.ms;
        fmt::print("| {} | {:.0f} | {:.1f} | {:.0f} | {:.1f} | {:.2f} |\n", name, times.first_ms, times.ms,
                   1e3 / times.ms, times.processor_ms, opengl_ms > 0 ? times.ms / opengl_ms : 0);
    }
    return 0;
}
