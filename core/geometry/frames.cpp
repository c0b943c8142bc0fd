#include "core/geometry/frames.h"

#include <array>
#include <utility>

namespace fluorocut {
namespace {

constexpr std::array<std::pair<Frame, std::string_view>, 9> kNames{{
    {Frame::femur, "femur"},
    {Frame::imager, "imager"},
    {Frame::corkscrew, "corkscrew"},
    {Frame::robot, "robot"},
    {Frame::flange, "flange"},
    {Frame::cutter, "cutter"},
    {Frame::cavity, "cavity"},
    {Frame::plate, "plate"},
    {Frame::phantom, "phantom"},
}};

}  // namespace

std::string_view name(Frame frame) {
    for (const auto& [known, text] : kNames) {
        if (known == frame) return text;
    }
    return "unknown";
}

std::optional<Frame> frameFromName(std::string_view name) {
    for (const auto& [known, text] : kNames) {
        if (text == name) return known;
    }
    return std::nullopt;
}

}  // namespace fluorocut
