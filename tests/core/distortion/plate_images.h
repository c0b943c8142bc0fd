// Pictures of a grooved plate behind a bent field of view, in closed form: no projector, no mesh, no lattice of samples
// but the pixels' own. The truth is a function from pixel to plate (frame `plate`, mm); everything that is measured
// against these pictures is independent of how they were made.
//
// The bend is an image intensifier's: pincushion, twist that grows outward (S-shape), a sigmoid along the columns.
// Lengths called "px at 512" are in pixels of an image 512 wide and scale with the image.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/base/random.h"
#include "core/distortion/grooved_plate.h"
#include "core/geometry/rigid3.h"
#include "core/image/image.h"

namespace fluorocut::test {

// pixel (u, v) -> plate mm.
struct BentField {
    int size_px = 512;                    // the image is square
    double pixel_mm = 0.32;               // where nothing bends
    double pincushion_px = 6;             // at the rim, px at 512
    double s_shape_px = 3;                // at the rim, px at 512
    Vector2 offset_px = Vector2::Zero();  // of the bend's centre from the image's middle, px at 512
    double rotation_rad = 0;              // of the plate in the image, any angle
    bool mirrored = false;
    Vector2 shift_mm = Vector2::Zero();

    // Pincushion of 5 to 8 px, S-shape of 2 to 5 px, any rotation, shift and handedness.
    static BentField random(int size_px, double pixel_mm, Random& random);
    static BentField straight(int size_px, double pixel_mm);

    Vector2 operator()(const Vector2& pixel) const;
};

struct PlateImageOptions {
    GroovedPlate plate;                 // its pitch and width; grooves limit its extent when given
    double contrast = 0.07;             // of the log intensity, groove against land
    double photons = 2000;              // per pixel at the middle of the field, without objects
    double blur_px = 0.7;               // standard deviation, px at 512, of the intensity before it is sampled
    Vector2 edge_mm = Vector2::Zero();  // edges slope over this length: walls of the grooves seen obliquely
    double field_radius = 0.49;         // of the round field, in image widths; 0: no field stop
    bool objects = false;               // ham, femur shaft, trabecular texture, clamp and screws
    double bar_mm = 0;                  // width of a metal bar along v, right across the field's middle; 0: none
    bool plate_present = true;
    bool grooves_along_x = true;
    bool grooves_along_y = true;
    double pitch_ratio = 1;  // pitch along y / pitch along x: 1 is the plate that was ordered
    double offset = 0;       // added to all pixels after the photons were counted
    bool inverted = false;
    std::optional<int> bits;  // digitised so that the brightest per mille saturates
    int samples = 3;          // per pixel and direction
};

struct PlateImage {
    Image image;
    Mask hidden;  // 1 where metal lies over the plate or the field ends
};

PlateImage renderPlate(const BentField& field, const PlateImageOptions& options, std::uint64_t seed);

}  // namespace fluorocut::test
