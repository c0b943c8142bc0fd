// The waves of a lattice: pairs of perpendicular peaks of equal length in the averaged spectrum of an image's patches.
#pragma once

#include <array>
#include <vector>

#include "core/geometry/rigid3.h"
#include "core/image/image.h"

namespace fluorocut::grooves {

// The spectrum of one lattice has several such pairs (harmonics, diagonals): the pair says nothing about which it is.
struct WavePair {
    Vector2 first = Vector2::Zero();   // cycles per pixel, within 45 degrees of +u
    Vector2 second = Vector2::Zero();  // about +90 degrees (u toward v) from the first
    double strength = 0;               // power over the background at that wavelength, the weaker of the two
};

struct WaveSearch {
    std::vector<WavePair> pairs;  // strongest first
    double strongest_single = 0;  // power over the background of the strongest peak, paired or not
    Vector2 strongest = Vector2::Zero();
};

// `image` is high-passed and 0 where nothing was seen. Periods in its pixels. Small patches stand strong bends, large
// ones are needed for long waves; `patch_px` is a power of two. Nothing is found when the patch is larger than the
// image, but for the smallest, 128.
WaveSearch findWaves(const Image& image, int patch_px, double min_period_px, double max_period_px);

// The pair with `first` turned and exchanged so that it is within 45 degrees of +u and `second` +90 degrees from it.
WavePair oriented(WavePair pair);

}  // namespace fluorocut::grooves
