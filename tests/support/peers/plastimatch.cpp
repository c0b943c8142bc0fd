#include "tests/support/peers/plastimatch.h"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>

#include <fmt/format.h>

#include "core/io/volume_file.h"

namespace fluorocut::test {

bool plastimatchIsInstalled() {
    return std::system("command -v plastimatch >/dev/null 2>&1") == 0;
}

void writeForPlastimatch(const Volume& hounsfield, const std::filesystem::path& path) {
    Volume density = hounsfield;
    for (float& value : density.voxels())
        value += 1000;
    const Result<void> written = writeVolume(path, density, VoxelType::float32);
    if (!written) throw std::runtime_error(written.error().message());
}

PlastimatchProjection runPlastimatch(const std::filesystem::path& volume, const CArm& carm,
                                     const Rigid3& imager_from_volume, const std::filesystem::path& scratch) {
    // It wants the isocentre, the direction to the source, and what is up on the detector.
    const Rigid3 volume_from_imager = imager_from_volume.inverse();
    const Vector3 source = volume_from_imager.translation();
    const Vector3 normal = -volume_from_imager.rotate(Vector3::UnitZ()),
                  up = -volume_from_imager.rotate(Vector3::UnitY());
    const double source_axis_mm = 500;
    const Vector3 isocentre = source - source_axis_mm * normal;
    const auto text = [](const Vector3& v) { return fmt::format("{:.17g} {:.17g} {:.17g}", v.x(), v.y(), v.z()); };
    // Its help says "row col" of -r and -z; it reads columns first.
    const std::string command = fmt::format(
        "plastimatch drr -i exact -P none -t pfm -r '{} {}' -z '{:.17g} {:.17g}' --sad {} --sid {:.17g} -o '{}' --nrm "
        "'{}' --vup '{}' -I '{}' -O '{}' 2>&1",
        carm.columns, carm.rows, carm.columns * carm.pixel_mm.x(), carm.rows * carm.pixel_mm.y(), source_axis_mm,
        carm.focal_length_mm, text(isocentre), text(normal), text(up), volume.string(), (scratch / "drr").string());
    const std::unique_ptr<FILE, int (*)(FILE*)> pipe(::popen(command.c_str(), "r"), &::pclose);
    if (!pipe) throw std::runtime_error("plastimatch cannot be started");
    std::string output;
    std::array<char, 256> buffer;
    while (std::fgets(buffer.data(), static_cast<int>(buffer.size()), pipe.get()))
        output += buffer.data();

    PlastimatchProjection result;
    const std::size_t at = output.find("Total time:");
    if (at == std::string::npos) throw std::runtime_error("plastimatch said: " + output);
    double total_s = std::stod(output.substr(at + 11));
    const std::size_t io = output.find("I/O time:");
    if (io != std::string::npos) total_s -= std::stod(output.substr(io + 9));
    result.elapsed_ms = 1000 * total_s;

    std::ifstream file(scratch / "drr0000.pfm", std::ios::binary);
    std::string line;
    for (int i = 0; i < 3; ++i)
        std::getline(file, line);
    result.line_integrals = Image(carm.columns, carm.rows);
    std::vector<float>& pixels = result.line_integrals.pixels();
    file.read(reinterpret_cast<char*>(pixels.data()), static_cast<std::streamsize>(pixels.size() * sizeof(float)));
    if (!file) throw std::runtime_error("plastimatch wrote no whole image");
    for (float& value : pixels)
        value *= 10;  // it writes integrals over cm
    return result;
}

}  // namespace fluorocut::test
