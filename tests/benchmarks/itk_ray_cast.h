// ITK's RayCastInterpolateImageFunction under ResampleImageFilter, its usual way to a digitally reconstructed
// radiograph.
//
// Plain arrays only: ITK brings its own copy of Eigen, which must not meet ours in one source file.
#pragma once

#include <array>
#include <memory>
#include <vector>

namespace fluorocut::benchmark {

// The detector in the volume's frame, mm.
struct ItkView {
    std::array<double, 3> source;
    std::array<double, 3> corner;     // centre of pixel (0, 0)
    std::array<double, 9> direction;  // row major; columns: along image columns, down the rows, the normal
    std::array<double, 2> pixel_mm;
    int columns, rows;
};

class ItkRayCast {
  public:
    // An axis-aligned volume.
    ItkRayCast(const std::vector<float>& values, const std::array<int, 3>& size,
               const std::array<double, 3>& spacing_mm, const std::array<double, 3>& origin_mm);
    ~ItkRayCast();

    // Integral of the values along each ray, mm.
    std::vector<float> project(const ItkView& view) const;

  private:
    struct Data;
    std::unique_ptr<Data> data_;
};

}  // namespace fluorocut::benchmark
