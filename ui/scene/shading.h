// How both renderers shade a surface: the light comes from the viewer, n is the normal's part toward the viewer.
//
//     colour  = colour of the item * (kAmbient + (1 - kAmbient) n) + shine n^kShininess
//     opacity = opacity n + rim_opacity (1 - n)
#pragma once

namespace fluorocut::ui {

inline constexpr double kAmbient = 0.22, kShininess = 30;

}  // namespace fluorocut::ui
