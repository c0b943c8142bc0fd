#include "ui/session/case_files.h"

#include <utility>

#include "core/base/units.h"
#include "core/io/file_format.h"
#include "core/io/image_file.h"
#include "core/io/mesh_file.h"
#include "core/io/volume_file.h"
#include "core/planning/implant_import.h"
#include "ui/session/case_document.h"

namespace fluorocut::ui {

namespace fs = std::filesystem;

namespace {

// As far as the file says it; what it does not say is CArm's usual value.
CaseView viewOf(const fs::path& file, ImageFile read) {
    CaseView view;
    view.name = file.stem().string();
    view.carm.columns = read.image.width();
    view.carm.rows = read.image.height();
    view.carm.principal_point_px = 0.5 * Vector2(read.image.width() - 1, read.image.height() - 1);
    if (read.info.imager_pixel_spacing_mm) view.carm.pixel_mm = *read.info.imager_pixel_spacing_mm;
    if (read.info.source_detector_mm) view.carm.focal_length_mm = *read.info.source_detector_mm;
    if (read.info.primary_angle_deg) view.position.orbital_rad = radiansFromDegrees(*read.info.primary_angle_deg);
    if (read.info.secondary_angle_deg)
        view.position.angulation_rad = radiansFromDegrees(*read.info.secondary_angle_deg);
    view.before.image = std::make_shared<const Image>(std::move(read.image));
    view.before.unregistered_because = "it was opened from a file: where the bone lies in it has not been found";
    return view;
}

Result<void> readImplant(const fs::path& file, ReadFiles& files) {
    // importImplant says it better than the reader when a mesh is in metres.
    Result<MeshFile> mesh = readMesh(file, {.unit = LengthUnit::mm, .require_solid = false});
    if (!mesh) return mesh.error();
    ImportOptions options;
    options.name = file.stem().string();
    Result<ImplantImport> imported = importImplant(std::move(mesh->mesh), options, file.string());
    if (!imported) return imported.error();
    files.implant = std::make_shared<const Implant>(std::move(imported->implant));
    files.notes.insert(files.notes.end(), imported->uncertain.begin(), imported->uncertain.end());
    return {};
}

Result<void> readCt(const fs::path& file, ReadFiles& files, Progress& progress) {
    Result<VolumeFile> volume = readVolume(file, {}, progress);
    if (!volume) return volume.error();
    files.ct = std::make_shared<const Volume>(std::move(volume->volume));
    return {};
}

Result<void> readPicture(const fs::path& file, ReadFiles& files) {
    Result<ImageFile> image = readImage(file);
    if (!image) return image.error();
    files.views.push_back(viewOf(file, std::move(*image)));
    return {};
}

Result<void> readOne(const fs::path& file, ReadFiles& files, Progress& progress) {
    if (looksLikeCase(file)) {
        if (files.whole)
            return invalidInput(file.string(), "a second case", "one case at a time", "open one after the other");
        Result<CaseState> state = readCase(file, progress);
        if (!state) return state.error();
        files.whole = std::move(*state);
        files.case_file = file;
        return {};
    }
    const Result<FileFormat> format = detectFormat(file);
    if (!format) return format.error();
    switch (*format) {
        case FileFormat::png:
        case FileFormat::tiff:
        case FileFormat::dicom:
            return readPicture(file, files);
        case FileFormat::dicomFolder:
        case FileFormat::nifti:
            return readCt(file, files, progress);
        case FileFormat::metaImage:
        case FileFormat::nrrd: {
            // A picture, or a stack of slices.
            Result<ImageFile> image = readImage(file);
            if (image && image->info.frames == 1) {
                files.views.push_back(viewOf(file, std::move(*image)));
                return {};
            }
            return readCt(file, files, progress);
        }
        case FileFormat::stl:
        case FileFormat::obj:
        case FileFormat::ply:
            return readImplant(file, files);
        case FileFormat::json:
        case FileFormat::unknown:
            break;
    }
    return invalidInput(file.string(), "a file of another kind",
                        "an image (PNG, TIFF, DICOM, MHA, NRRD), a CT (DICOM folder, NIfTI, NRRD, MHA), a mesh (STL, "
                        "OBJ, PLY) or a saved case");
}

}  // namespace

Result<ReadFiles> readCaseFiles(const std::vector<fs::path>& files, Progress& progress) {
    ReadFiles read;
    for (std::size_t i = 0; i < files.size(); ++i) {
        if (progress.isCancelled()) return cancelled("reading files");
        const double begin = static_cast<double>(i) / static_cast<double>(files.size());
        const double end = static_cast<double>(i + 1) / static_cast<double>(files.size());
        progress.report(begin, files[i].filename().string());
        SubProgress one(progress, begin, end);
        if (const Result<void> done = readOne(files[i], read, one); !done) return done.error();
    }
    return read;
}

CaseState ReadFiles::addedTo(CaseState state) const {
    if (whole) state = *whole;
    state.views.insert(state.views.end(), views.begin(), views.end());
    if (ct) state.ct = ct;
    if (implant) {
        ImplantPlan& plan = state.plan;
        plan.family = implant->family;
        plan.size = implant->size;
        plan.implant = implant;
        plan.mesh = std::shared_ptr<const TriangleMesh>(implant, &implant->parts.front().mesh);
        plan.cavities.clear();
        // A plan that there was keeps its place; else where it can be seen and taken.
        if (!state.views.empty() || state.ct) {
            const bool placed = plan.femur_from_implant.translation().norm() > 0;
            if (!placed && state.canal) plan.femur_from_implant = Rigid3::fromTranslation(state.canal->proximal);
            if (!placed && !state.canal && state.ct)
                plan.femur_from_implant = Rigid3::fromTranslation(state.ct->grid().center());
        }
    }
    return state;
}

}  // namespace fluorocut::ui
