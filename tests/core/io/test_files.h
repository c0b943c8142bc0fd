// What the tests of readers and writers share.
#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>

#include "core/image/volume.h"

namespace fluorocut::test {

inline std::string content(const std::filesystem::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

inline void put(const std::filesystem::path& path, std::string_view bytes) {
    std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

// 7 x 5 x 4 voxels, anisotropic, oblique, far from the origin, left-handed when asked for; whole numbers of HU.
inline Volume obliqueVolume(bool left_handed) {
    VolumeGrid grid;
    grid.size = {7, 5, 4};
    grid.spacing_mm = {0.7, 1.1, 3.0};
    grid.origin_mm = {-120.25, 33.5, -980.125};
    grid.direction = Rigid3::fromTwistRollPitch(0.4, -0.7, 2.9).rotationMatrix();
    if (left_handed) grid.direction.col(2) *= -1;
    Volume volume(grid);
    for (std::size_t i = 0; i < volume.voxels().size(); ++i) {
        volume.voxels()[i] = static_cast<float>(static_cast<int>(i * 37 % 4000) - 1000);
    }
    return volume;
}

}  // namespace fluorocut::test
