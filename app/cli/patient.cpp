#include "app/cli/patient.h"

#include <filesystem>
#include <utility>

#include "core/io/volume_file.h"
#include "core/simulation/acrylic_phantom.h"
#include "core/simulation/femur_phantom.h"

namespace fluorocut::cli {
namespace {

template <class T, class U>
Result<std::shared_ptr<const Volume>> shared(Result<T> made, U T::*volume) {
    if (!made) return made.error();
    return std::make_shared<const Volume>(std::move((*made).*volume));
}

}  // namespace

Result<std::shared_ptr<const Volume>> loadCt(const std::string& name, Progress& progress) {
    std::error_code ignored;
    if (!std::filesystem::exists(name, ignored)) {
        if (name == kBuiltInFemur) return shared(generateFemur({}, progress), &FemurPhantom::ct);
        if (name == kBuiltInAcrylic) return shared(generateAcrylicBlock({}, progress), &AcrylicPhantom::ct);
    }
    return shared(readVolume(name, {}, progress), &VolumeFile::volume);
}

}  // namespace fluorocut::cli
