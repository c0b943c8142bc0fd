#include "ui/scene/scene.h"

#include <algorithm>

#include <Eigen/Geometry>

namespace fluorocut::ui {

SceneBall ballAround(const std::vector<SceneItem>& items) {
    Eigen::AlignedBox3d box;
    for (const SceneItem& item : items) {
        if (!(item.radius_mm > 0)) continue;
        const Vector3 middle = item.femur_from_item * item.middle;
        box.extend(middle - Vector3::Constant(item.radius_mm));
        box.extend(middle + Vector3::Constant(item.radius_mm));
    }
    if (box.isEmpty()) return {};
    SceneBall ball{box.center(), 0};
    for (const SceneItem& item : items) {
        if (!(item.radius_mm > 0)) continue;
        const double reach = (item.femur_from_item * item.middle - ball.middle).norm() + item.radius_mm;
        ball.radius_mm = std::max(ball.radius_mm, reach);
    }
    return ball;
}

void measure(SceneItem& item) {
    Eigen::AlignedBox3d box;
    const auto each = [&](const auto& visit) {
        if (item.surface)
            for (const Vector3& p : item.surface->vertices)
                visit(p);
        if (item.lines)
            for (const auto& line : *item.lines)
                for (const Vector3& p : line)
                    visit(p);
    };
    each([&](const Vector3& p) { box.extend(p); });
    if (box.isEmpty()) return;
    item.middle = box.center();
    double squared = 0;
    each([&](const Vector3& p) { squared = std::max(squared, (p - item.middle).squaredNorm()); });
    item.radius_mm = std::sqrt(squared);
}

}  // namespace fluorocut::ui
