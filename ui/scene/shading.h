// How both renderers shade a surface: the light comes from the viewer, n is the normal's part toward the viewer.
//
//     colour  = colour of the item * (ambient + (1 - ambient) n) + shine n^kShininess
//     opacity = opacity n + rim_opacity (1 - n)
#pragma once

namespace fluorocut::ui {

inline constexpr double kShininess = 30;

}  // namespace fluorocut::ui
