// Families of parametric femoral stems: a table of sizes and the rules that turn a row of it into meshes. They resemble
// the kinds of stems in use and are no manufacturer's product.
//
// The stem's body, frame `cavity` of a left stem (core/planning/implant.h), t = height above the tip / length:
//
//     width(t)  = distal + (proximal - distal) (e t + (1 - e) t^p)    along x, e = even_taper, p = flare_power; the
//                                                                     late part of the growth lies on the medial side
//     depth(t)  = distal + (proximal - distal) t                      along y
//     section   |x / a|^q + |y / b|^q = 1, q from distal_exponent to proximal_exponent; rounded at the tip
//     curve(t)  = -posterior_curve ((t - 0.5) / 0.5)^2                y of the middle, t > 0.5
//     flutes    the radius falls by depth (1 - cos(n angle)) / 2 between two levels (fractions of the length)
//
// Above the resection (z = 0) the sections turn about a line beside the medial corner until they stand across the neck;
// the neck is round and ends in a 12/14 taper. The head is a sphere with a conical bore, a skirt where its neck length
// asks for one. The head's centre lies at (offset, 0, head_height) from the resection, turned by the anteversion about
// the axis through the body's middle there; neck lengths move it along the neck.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/result.h"
#include "core/planning/implant.h"

namespace fluorocut {

struct StemSize {
    std::string name;
    double length_mm = 0;       // tip to resection
    Vector2 distal_mm{0, 0};    // width and depth at the tip, before its rounding
    Vector2 proximal_mm{0, 0};  // at the resection
    double offset_mm = 0;       // head's centre to stem's axis with the neck length 0, in the neck's plane
    double head_height_mm = 0;  // above the resection
};

struct ImplantFamily {
    std::string name;
    std::string description;
    std::string basis;  // where the sizes and their increments come from
    Material stem_material = Material::titanium;
    Material head_material = Material::cobaltChrome;

    double even_taper = 0.5;
    double flare_power = 4;
    double distal_exponent = 2;
    double proximal_exponent = 4;
    double posterior_curve_mm = 0;
    int flutes = 0;
    double flute_depth_mm = 0;
    Vector2 flute_levels{0.1, 0.7};  // fractions of the length above the tip
    double neck_shaft_angle_rad = 0;
    double anteversion_rad = 0;

    std::vector<double> necks_mm;  // what a head adds to the neck's length
    std::vector<double> heads_mm;  // diameters
    std::vector<StemSize> sizes;   // rising

    // Names the field, the value and the limit; a size whose neck does not fit its body is named.
    Result<void> validate() const;
};

struct ImplantChoice {
    std::string size = {};          // empty: the middle one
    std::optional<Side> side = {};  // unset: left; of an implant that a mesh gives, its own
    double head_mm = 32;
    double neck_mm = 0;
    int triangles = 12000;  // of the stem, about: 500 to 400,000
};

// invalidOption names what the family offers.
Result<Implant> makeImplant(const ImplantFamily& family, const ImplantChoice& choice = {});

}  // namespace fluorocut
