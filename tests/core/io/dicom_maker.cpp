#include "tests/core/io/dicom_maker.h"

#include <cstring>
#include <memory>
#include <mutex>
#include <sstream>
#include <stdexcept>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcfilefo.h>
#include <dcmtk/dcmdata/dcpixel.h>
#include <dcmtk/dcmdata/dcpixseq.h>
#include <dcmtk/dcmdata/dcpxitem.h>
#include <dcmtk/dcmdata/dcrleerg.h>
#include <dcmtk/dcmdata/dcrlerp.h>
#include <dcmtk/dcmdata/dcuid.h>
#include <dcmtk/dcmjpeg/djencode.h>
#include <dcmtk/dcmjpeg/djrplol.h>
#include <dcmtk/dcmjpeg/djrploss.h>
#include <dcmtk/dcmjpls/djencode.h>
#include <openjpeg.h>
#include <unistd.h>

namespace fluorocut::test {

namespace fs = std::filesystem;

namespace {

void require(const OFCondition& status, const char* what) {
    if (status.bad()) throw std::runtime_error(std::string(what) + ": " + status.text());
}

void registerEncoders() {
    static std::once_flag once;
    std::call_once(once, [] {
        OFLog::configure(OFLogger::OFF_LOG_LEVEL);
        DJEncoderRegistration::registerCodecs(ECC_lossyYCbCr, EUC_never, OFFalse, 0, 0, 0, OFFalse);
        DJLSEncoderRegistration::registerCodecs();
        DcmRLEEncoderRegistration::registerCodecs();
    });
}

std::vector<Uint8> encodeJpeg2000(const DicomImage& image, int frame) {
    opj_image_cmptparm_t parameter{};
    parameter.dx = parameter.dy = 1;
    parameter.w = static_cast<OPJ_UINT32>(image.width);
    parameter.h = static_cast<OPJ_UINT32>(image.height);
    parameter.prec = static_cast<OPJ_UINT32>(image.bits_stored);
    parameter.sgnd = image.is_signed;
    const std::unique_ptr<opj_image_t, decltype(&opj_image_destroy)> picture(
        opj_image_create(1, &parameter, OPJ_CLRSPC_GRAY), opj_image_destroy);
    picture->x1 = parameter.w;
    picture->y1 = parameter.h;
    const std::size_t count = static_cast<std::size_t>(image.width * image.height);
    for (std::size_t i = 0; i < count; ++i) {
        const std::uint16_t raw = image.pixels[static_cast<std::size_t>(frame) * count + i];
        const int wrap = image.is_signed && (raw >> (image.bits_stored - 1)) & 1 ? 1 << image.bits_stored : 0;
        picture->comps[0].data[i] = static_cast<OPJ_INT32>(raw) - wrap;
    }
    opj_cparameters_t parameters;
    opj_set_default_encoder_parameters(&parameters);
    parameters.numresolution = 3;
    parameters.tcp_numlayers = 1;
    parameters.cp_disto_alloc = 1;
    const std::unique_ptr<opj_codec_t, decltype(&opj_destroy_codec)> codec(opj_create_compress(OPJ_CODEC_J2K),
                                                                           opj_destroy_codec);
    if (!opj_setup_encoder(codec.get(), &parameters, picture.get())) throw std::runtime_error("opj_setup_encoder");
    const fs::path scratch = fs::temp_directory_path() / ("fluorocut-test-" + std::to_string(::getpid()) + ".j2k");
    {
        const std::unique_ptr<opj_stream_t, decltype(&opj_stream_destroy)> stream(
            opj_stream_create_default_file_stream(scratch.c_str(), OPJ_FALSE), opj_stream_destroy);
        if (!opj_start_compress(codec.get(), picture.get(), stream.get()) || !opj_encode(codec.get(), stream.get()) ||
            !opj_end_compress(codec.get(), stream.get())) {
            throw std::runtime_error("opj_encode");
        }
    }
    std::vector<Uint8> bytes(fs::file_size(scratch));
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(scratch.c_str(), "rb"), std::fclose);
    if (std::fread(bytes.data(), 1, bytes.size(), file.get()) != bytes.size()) throw std::runtime_error("j2k");
    fs::remove(scratch);
    if (bytes.size() % 2) bytes.push_back(0);
    return bytes;
}

E_TransferSyntax dcmtkSyntax(Syntax syntax) {
    switch (syntax) {
        case Syntax::implicitLittle:
            return EXS_LittleEndianImplicit;
        case Syntax::explicitLittle:
            return EXS_LittleEndianExplicit;
        case Syntax::explicitBig:
            return EXS_BigEndianExplicit;
        case Syntax::deflated:
            return EXS_DeflatedLittleEndianExplicit;
        case Syntax::rle:
            return EXS_RLELossless;
        case Syntax::jpegBaseline:
            return EXS_JPEGProcess1;
        case Syntax::jpegExtended:
            return EXS_JPEGProcess2_4;
        case Syntax::jpegLossless:
            return EXS_JPEGProcess14;
        case Syntax::jpegLosslessSv1:
            return EXS_JPEGProcess14SV1;
        case Syntax::jpegLs:
            return EXS_JPEGLSLossless;
        case Syntax::jpeg2000:
            return EXS_JPEG2000LosslessOnly;
    }
    throw std::logic_error("Syntax");
}

}  // namespace

void makeDicom(const fs::path& path, const DicomImage& image) {
    registerEncoders();
    DcmFileFormat file;
    DcmDataset& data = *file.getDataset();
    const auto text = [&](const DcmTagKey& key, const std::string& value) {
        // a key alone has no value representation; a tag takes it from the dictionary ("xs": by PixelRepresentation)
        if (DcmTag(key).getEVR() == EVR_xs) {
            require(data.putAndInsertUint16(key, static_cast<Uint16>(std::stoi(value))), "number");
        } else {
            require(data.putAndInsertString(key, value.c_str()), "text");
        }
    };
    char uid[100];
    text(DCM_SOPClassUID, UID_XRayAngiographicImageStorage);
    text(DCM_SOPInstanceUID, dcmGenerateUniqueIdentifier(uid));
    text(DCM_Modality, "XA");
    text(DCM_PhotometricInterpretation, "MONOCHROME2");
    const auto number = [&](const DcmTagKey& key, int value) {
        require(data.putAndInsertUint16(key, static_cast<Uint16>(value)), "number");
    };
    number(DCM_SamplesPerPixel, 1);
    number(DCM_Rows, image.height);
    number(DCM_Columns, image.width);
    number(DCM_BitsAllocated, image.bits_allocated);
    number(DCM_BitsStored, image.bits_stored);
    number(DCM_HighBit, image.bits_stored - 1);
    number(DCM_PixelRepresentation, image.is_signed);
    if (image.frames > 1) text(DCM_NumberOfFrames, std::to_string(image.frames));
    for (const auto& [key, value] : image.attributes)
        text(DcmTagKey(key.first, key.second), value);

    const E_TransferSyntax syntax = dcmtkSyntax(image.syntax);
    if (image.syntax == Syntax::jpeg2000) {
        auto sequence = std::make_unique<DcmPixelSequence>(DCM_PixelSequenceTag);
        sequence->insert(new DcmPixelItem(DCM_PixelItemTag));
        for (int frame = 0; frame < image.frames; ++frame) {
            std::vector<Uint8> bytes = encodeJpeg2000(image, frame);
            auto* item = new DcmPixelItem(DCM_PixelItemTag);
            require(item->putUint8Array(bytes.data(), static_cast<unsigned long>(bytes.size())), "fragment");
            sequence->insert(item);
        }
        auto* pixels = new DcmPixelData(DCM_PixelData);
        pixels->putOriginalRepresentation(syntax, nullptr, sequence.release());
        require(data.insert(pixels), "pixel data");
    } else if (image.bits_allocated == 8) {
        std::vector<Uint8> bytes(image.pixels.begin(), image.pixels.end());
        require(data.putAndInsertUint8Array(DCM_PixelData, bytes.data(), static_cast<unsigned long>(bytes.size())),
                "pixels");
    } else {
        require(data.putAndInsertUint16Array(DCM_PixelData, image.pixels.data(),
                                             static_cast<unsigned long>(image.pixels.size())),
                "pixels");
    }
    const DJ_RPLossless lossless(image.syntax == Syntax::jpegLosslessSv1 ? 1 : 6, 0);
    const DJ_RPLossy lossy(95);
    const DcmRLERepresentationParameter rle;
    if (image.syntax == Syntax::rle) require(data.chooseRepresentation(syntax, &rle), "RLE");
    if (image.syntax == Syntax::jpegLossless || image.syntax == Syntax::jpegLosslessSv1) {
        require(data.chooseRepresentation(syntax, &lossless), "JPEG lossless");
    }
    if (image.syntax == Syntax::jpegBaseline || image.syntax == Syntax::jpegExtended) {
        require(data.chooseRepresentation(syntax, &lossy), "JPEG");
    }
    if (image.syntax == Syntax::jpegLs) require(data.chooseRepresentation(syntax, nullptr), "JPEG-LS");
    require(file.saveFile(path.c_str(), syntax), "save");
}

float ctValue(int x, int y, int id) {
    return static_cast<float>(x * 11 + y * 23 + id * 50 - 1000);
}

void makeCtSlice(const fs::path& path, const CtSlice& slice) {
    DicomImage image;
    image.width = slice.width;
    image.height = slice.height;
    image.syntax = slice.syntax;
    for (int y = 0; y < slice.height; ++y) {
        for (int x = 0; x < slice.width; ++x) {
            image.pixels.push_back(static_cast<std::uint16_t>(ctValue(x, y, slice.id) + 1024));
        }
    }
    const auto list = [](std::initializer_list<double> values) {
        std::ostringstream text;
        text.precision(9);
        for (const double value : values)
            text << (text.tellp() > 0 ? "\\" : "") << value;
        return text.str();
    };
    const Vector3 &p = slice.position, &r = slice.row, &c = slice.column;
    image.attributes = {
        {{0x0008, 0x0016}, UID_CTImageStorage},
        {{0x0008, 0x0060}, "CT"},
        {{0x0018, 0x0050}, "2"},
        {{0x0020, 0x000e}, slice.series},
        {{0x0020, 0x0032}, list({p.x(), p.y(), p.z()})},
        {{0x0020, 0x0037}, list({r.x(), r.y(), r.z(), c.x(), c.y(), c.z()})},
        {{0x0028, 0x0030}, list({slice.between_rows_mm, slice.between_columns_mm})},
        {{0x0028, 0x1052}, "-1024"},
        {{0x0028, 0x1053}, "1"},
    };
    for (const auto& [key, value] : slice.attributes)
        image.attributes[key] = value;
    makeDicom(path, image);
}

}  // namespace fluorocut::test
