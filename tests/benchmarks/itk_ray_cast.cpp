#include "tests/benchmarks/itk_ray_cast.h"

#include <algorithm>

#include <itkEuler3DTransform.h>
#include <itkImage.h>
#include <itkRayCastInterpolateImageFunction.h>
#include <itkResampleImageFilter.h>

namespace fluorocut::benchmark {

using ItkVolume = itk::Image<float, 3>;

struct ItkRayCast::Data {
    ItkVolume::Pointer volume;
};

ItkRayCast::ItkRayCast(const std::vector<float>& values, const std::array<int, 3>& size,
                       const std::array<double, 3>& spacing_mm, const std::array<double, 3>& origin_mm)
    : data_(std::make_unique<Data>()) {
    data_->volume = ItkVolume::New();
    ItkVolume::SizeType region;
    for (unsigned axis = 0; axis < 3; ++axis)
        region[axis] = static_cast<itk::SizeValueType>(size[axis]);
    data_->volume->SetRegions(region);
    data_->volume->SetSpacing(spacing_mm.data());
    data_->volume->SetOrigin(origin_mm.data());
    data_->volume->Allocate();
    std::copy(values.begin(), values.end(), data_->volume->GetBufferPointer());
}

ItkRayCast::~ItkRayCast() = default;

std::vector<float> ItkRayCast::project(const ItkView& view) const {
    // The detector is an image of one slice in the volume's frame; the ray caster goes from the focal point through it.
    using Interpolator = itk::RayCastInterpolateImageFunction<ItkVolume, double>;
    const auto interpolator = Interpolator::New();
    const auto transform = itk::Euler3DTransform<double>::New();
    transform->SetIdentity();
    interpolator->SetTransform(transform);
    interpolator->SetThreshold(0);
    interpolator->SetFocalPoint(Interpolator::InputPointType(view.source.data()));

    const auto filter = itk::ResampleImageFilter<ItkVolume, ItkVolume>::New();
    filter->SetInput(data_->volume);
    filter->SetInterpolator(interpolator);
    filter->SetTransform(transform);
    filter->SetDefaultPixelValue(0);
    filter->SetSize({static_cast<itk::SizeValueType>(view.columns), static_cast<itk::SizeValueType>(view.rows), 1});
    const double spacing[3] = {view.pixel_mm[0], view.pixel_mm[1], 1};
    filter->SetOutputSpacing(spacing);
    filter->SetOutputOrigin(view.corner.data());
    ItkVolume::DirectionType direction;
    for (unsigned row = 0; row < 3; ++row) {
        for (unsigned column = 0; column < 3; ++column)
            direction(row, column) = view.direction[3 * row + column];
    }
    filter->SetOutputDirection(direction);
    filter->Update();
    const float* pixels = filter->GetOutput()->GetBufferPointer();
    return {pixels, pixels + static_cast<std::ptrdiff_t>(view.columns) * view.rows};
}

}  // namespace fluorocut::benchmark
