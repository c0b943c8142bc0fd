// What the subcommands of dewarp share: where the map of an image comes from.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "app/cli/command.h"
#include "core/distortion/distortion_map.h"
#include "core/distortion/groove_detection.h"
#include "core/io/image_file.h"

namespace fluorocut::cli {

// Either a map's file, or a set of maps and the C-arm's angles, or (the plate left on) the plate's file.
struct MapOptions {
    std::string map;
    std::string maps;
    double orbital_deg = std::numeric_limits<double>::quiet_NaN();  // NaN: as the image's file says
    double angulation_deg = std::numeric_limits<double>::quiet_NaN();
    std::string plate;  // file or name
    DistortionFitOptions fit;
};

void addMapOptions(CLI::App* app, MapOptions& options, bool plate_on);
void addModelOptions(CLI::App* app, DistortionFitOptions& options);
std::vector<std::filesystem::path> inputsOf(const MapOptions& options);

// `image`: what is to be straightened, where there is one.
Result<DistortionMap> mapFor(const MapOptions& options, const ImageFile* image, Progress& progress);

struct PlateFit {
    GrooveDetection grooves;
    DistortionMap map;
    double fit_ms = 0;
};
// `plate`: a plate's file, or the name of one that comes with FluoroCut.
Result<PlateFit> fitPlate(const std::string& plate, const Image& image, const DistortionFitOptions& options,
                          Progress& progress);

// As the C-arm's scales stood: from the command line, else from the image's file.
std::optional<CArmPosition> positionOf(double orbital_deg, double angulation_deg, const ImageInfo* info);

// "2026-03-01T09:30:00Z"
std::string nowUtc();

Command declareDewarpFit(CLI::App& parent);
Command declareDewarpApply(CLI::App& parent);
Command declareDewarpPoints(CLI::App& parent);
Command declareDewarpVerify(CLI::App& parent);
Command declareDewarpCollect(CLI::App& parent);

}  // namespace fluorocut::cli
