#include "core/io/formats/dicom_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <mutex>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcfilefo.h>
#include <dcmtk/dcmdata/dcmetinf.h>
#include <dcmtk/dcmdata/dcpixel.h>
#include <dcmtk/dcmdata/dcpixseq.h>
#include <dcmtk/dcmdata/dcpxitem.h>
#include <dcmtk/dcmdata/dcuid.h>
#include <dcmtk/dcmjpeg/djdecode.h>
#include <dcmtk/dcmjpls/djdecode.h>
#include <fmt/format.h>

#include "core/io/formats/byte_reader.h"
#include "core/io/formats/pixels.h"
#include "core/io/formats/raster.h"

namespace fluorocut {

namespace fs = std::filesystem;

namespace {

void prepareDcmtk() {
    static std::once_flag once;
    std::call_once(once, [] {
        OFLog::configure(OFLogger::OFF_LOG_LEVEL);  // it would write to stderr; what matters is in our errors
        DJDecoderRegistration::registerCodecs(EDC_photometricInterpretation, EUC_never, EPC_colorByPixel);
        DJLSDecoderRegistration::registerCodecs();
    });
}

DcmTagKey key(DicomTag tag) {
    return {tag.group, tag.element};
}

bool isJpeg2000(E_TransferSyntax syntax) {
    return syntax == EXS_JPEG2000 || syntax == EXS_JPEG2000LosslessOnly;
}

bool isJpeg(E_TransferSyntax syntax) {
    return syntax == EXS_JPEGProcess1 || syntax == EXS_JPEGProcess2_4 || syntax == EXS_JPEGProcess14 ||
           syntax == EXS_JPEGProcess14SV1 || syntax == EXS_JPEGLSLossless || syntax == EXS_JPEGLSLossy;
}

// Whether a JPEG or JPEG-LS stream declares this size in its frame header (marker SOFn): DCMTK leaves the rest of a
// frame as it was when the stream holds a smaller picture.
bool jpegSizeIs(const std::vector<std::uint8_t>& bytes, int width, int height) {
    std::size_t at = 2;
    while (at + 9 < bytes.size()) {
        if (bytes[at] != 0xFF) return false;
        const int marker = bytes[at + 1];
        if (marker == 0xFF) {  // fill byte
            ++at;
            continue;
        }
        const bool frame =
            (marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC) || marker == 0xF7;
        if (frame) {
            return bytes[at + 5] * 256 + bytes[at + 6] == height && bytes[at + 7] * 256 + bytes[at + 8] == width;
        }
        at += 2 + static_cast<std::size_t>(bytes[at + 2] * 256 + bytes[at + 3]);
    }
    return false;
}

bool canDecode(E_TransferSyntax syntax) {
    switch (syntax) {
        case EXS_LittleEndianImplicit:
        case EXS_LittleEndianExplicit:
        case EXS_BigEndianExplicit:
        case EXS_BigEndianImplicit:
        case EXS_DeflatedLittleEndianExplicit:
        case EXS_RLELossless:
        case EXS_JPEGProcess1:
        case EXS_JPEGProcess2_4:
        case EXS_JPEGProcess14:
        case EXS_JPEGProcess14SV1:
        case EXS_JPEGLSLossless:
        case EXS_JPEGLSLossy:
        case EXS_JPEG2000:
        case EXS_JPEG2000LosslessOnly:
            return true;
        default:
            return false;
    }
}

}  // namespace

struct DicomFile::Impl {
    fs::path path;
    std::uint64_t file_bytes = 0;
    mutable DcmFileFormat file;  // DCMTK loads large values when they are asked for, so nothing of it is const
    E_TransferSyntax syntax = EXS_Unknown;
    std::string syntax_uid;

    DcmDataset& dataset() const { return *file.getDataset(); }
    DcmPixelData* pixelData() const {
        DcmElement* element = nullptr;
        if (dataset().findAndGetElement(DCM_PixelData, element).bad()) return nullptr;
        return dynamic_cast<DcmPixelData*>(element);
    }
    Error bad(std::string field, std::string found, std::string expected, std::string advice = {}) const {
        return invalidInput(path.string() + (field.empty() ? "" : ", DICOM " + field), std::move(found),
                            std::move(expected), std::move(advice));
    }
    DcmPixelSequence* sequence() const {
        DcmPixelData* pixels = pixelData();
        DcmPixelSequence* result = nullptr;
        E_TransferSyntax original = EXS_Unknown;
        const DcmRepresentationParameter* parameter = nullptr;
        if (!pixels) return nullptr;
        pixels->getOriginalRepresentationKey(original, parameter);
        if (pixels->getEncapsulatedRepresentation(original, parameter, result).bad()) return nullptr;
        return result;
    }
    Result<std::vector<std::uint8_t>> fragments(int frame, int frames) const;
    Result<std::vector<float>> jpeg2000Frame(const DicomPixelFormat& format, int index) const;
};

DicomFile::DicomFile(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
DicomFile::DicomFile(DicomFile&&) noexcept = default;
DicomFile& DicomFile::operator=(DicomFile&&) noexcept = default;
DicomFile::~DicomFile() = default;

Result<DicomFile> DicomFile::open(const fs::path& path) {
    prepareDcmtk();
    const Result<std::uint64_t> size = inputFileSize(path);
    if (!size) return size.error();
    if (Result<void> sane = checkDicomNesting(path); !sane) return sane.error();
    auto impl = std::make_unique<Impl>();
    impl->path = path;
    impl->file_bytes = *size;
    const OFCondition loaded = impl->file.loadFile(path.c_str());
    OFString uid;
    impl->file.getMetaInfo()->findAndGetOFString(DCM_TransferSyntaxUID, uid);
    impl->syntax_uid = printable(uid.c_str());
    if (loaded.bad()) {
        const std::string why = DcmXfer(uid.c_str()).getXfer() == EXS_Unknown && !uid.empty()
                                    ? "the transfer syntax " + impl->syntax_uid
                                    : fmt::format("a DICOM file that cannot be parsed ({})", loaded.text());
        return impl->bad("", why, "a whole DICOM file", "export it again, uncompressed");
    }
    impl->syntax = impl->dataset().getOriginalXfer();
    if (impl->dataset().card() == 0) return impl->bad("", "no attribute", "a DICOM image");
    return DicomFile(std::move(impl));
}

bool DicomFile::has(DicomTag tag) const {
    return impl_->dataset().tagExistsWithValue(key(tag));
}

std::string DicomFile::text(DicomTag tag) const {
    OFString value;
    if (impl_->dataset().findAndGetOFStringArray(key(tag), value).bad()) return {};
    // control characters come from damage; what is above ASCII is a name in the file's character set
    std::string result(trimmed(value.c_str()));
    std::replace_if(
        result.begin(), result.end(), [](unsigned char c) { return c < 32 || c == 127; }, '?');
    return result;
}

std::vector<double> DicomFile::numbers(DicomTag tag) const {
    std::vector<double> values;
    const std::string content = text(tag);
    std::string_view rest = content;
    while (!rest.empty()) {
        const std::size_t end = std::min(rest.find('\\'), rest.size());
        double value = NAN;
        if (!parseNumber(trimmed(rest.substr(0, end)), value)) value = NAN;
        values.push_back(value);
        rest.remove_prefix(std::min(end + 1, rest.size()));
        if (values.size() > 4096) break;
    }
    return values;
}

std::optional<double> DicomFile::number(DicomTag tag) const {
    const std::vector<double> values = numbers(tag);
    if (values.empty()) return std::nullopt;
    return values.front();
}

std::string DicomFile::transferSyntax() const {
    return impl_->syntax == EXS_Unknown ? impl_->syntax_uid : DcmXfer(impl_->syntax).getXferName();
}

bool DicomFile::hasPixelData() const {
    return impl_->pixelData() != nullptr;
}

bool DicomFile::hasIdentifyingFields() const {
    for (const DcmTagKey& field :
         {DCM_PatientName, DCM_PatientID, DCM_PatientBirthDate, DCM_OtherPatientIDsSequence,
          DCM_RETIRED_OtherPatientIDs, DCM_OtherPatientNames, DCM_PatientAddress, DCM_PatientTelephoneNumbers,
          DCM_PatientMotherBirthName, DCM_AccessionNumber, DCM_ReferringPhysicianName, DCM_InstitutionName}) {
        if (impl_->dataset().tagExistsWithValue(field)) return true;
    }
    return false;
}

Result<DicomPixelFormat> DicomFile::pixelFormat() const {
    const Impl& d = *impl_;
    if (!d.pixelData()) return d.bad("", "no pixel data", "an image", "choose a file that holds an image");
    if (!canDecode(d.syntax)) {
        return d.bad("transfer syntax", transferSyntax() + ", which cannot be read",
                     "uncompressed, RLE, JPEG, JPEG-LS or JPEG 2000", "export it uncompressed");
    }
    const auto integer = [&](const DcmTagKey& field, int otherwise) {
        OFString value;
        if (d.dataset().findAndGetOFString(field, value).bad() || value.empty()) return otherwise;
        std::int64_t number = 0;
        if (!parseInteger(trimmed(value.c_str()), number) || std::abs(number) > 1'000'000'000) return -1;
        return static_cast<int>(number);
    };
    DicomPixelFormat format;
    format.width = integer(DCM_Columns, -1);
    format.height = integer(DCM_Rows, -1);
    format.frames = integer(DCM_NumberOfFrames, 1);
    format.samples = integer(DCM_SamplesPerPixel, 1);
    format.bits_allocated = integer(DCM_BitsAllocated, -1);
    format.bits_stored = integer(DCM_BitsStored, format.bits_allocated);
    format.high_bit = integer(DCM_HighBit, format.bits_stored - 1);
    format.is_signed = integer(DCM_PixelRepresentation, 0) == 1;
    format.planar = integer(DCM_PlanarConfiguration, 0) == 1;
    OFString photometric;
    d.dataset().findAndGetOFString(DCM_PhotometricInterpretation, photometric);
    format.photometric = std::string(trimmed(photometric.c_str()));

    if (!(format.bits_allocated == 8 || format.bits_allocated == 16)) {
        return d.bad("BitsAllocated", fmt::format("{}", format.bits_allocated), "8 or 16");
    }
    if (!(format.bits_stored >= 1 && format.bits_stored <= format.bits_allocated &&
          format.high_bit >= format.bits_stored - 1 && format.high_bit < format.bits_allocated)) {
        return d.bad("BitsStored and HighBit", fmt::format("{} and {}", format.bits_stored, format.high_bit),
                     fmt::format("bits within the {} allocated", format.bits_allocated));
    }
    const bool grey = format.samples == 1 && format.photometric.starts_with("MONOCHROME");
    const bool colour = format.samples == 3 && format.bits_allocated == 8 &&
                        (format.photometric == "RGB" || format.photometric.starts_with("YBR"));
    if (!grey && !colour) {
        return d.bad("PhotometricInterpretation",
                     fmt::format("{} of {} samples", printable(format.photometric), format.samples),
                     "MONOCHROME1, MONOCHROME2 or RGB", "export it as greyscale");
    }
    if (!(format.frames >= 1)) {
        return d.bad("NumberOfFrames", fmt::format("{}", format.frames), "at least 1");
    }
    // What a frame takes in the file: all of it when native; compressed, next to nothing where an image is blank.
    const bool encapsulated = DcmXfer(d.syntax).isEncapsulated();
    const bool packed = encapsulated || d.syntax == EXS_DeflatedLittleEndianExplicit;
    const double bytes = format.samples * format.bits_allocated / 8.0;
    if (format.width < 1 || format.height < 1) {
        return d.bad("Rows x Columns", fmt::format("{} x {}", format.height, format.width), "at least 1 x 1");
    }
    const double frame_bytes = static_cast<double>(format.width) * format.height * bytes;
    constexpr double kBlank = 64 << 20;
    if (Result<void> size =
            checkImageSize(d.path, static_cast<std::uint64_t>(format.width), static_cast<std::uint64_t>(format.height),
                           packed && frame_bytes <= kBlank ? 0 : bytes, packed ? 4096 : 1);
        !size) {
        return size.error();
    }
    if (encapsulated) {
        DcmPixelSequence* sequence = d.sequence();
        const auto items = sequence ? sequence->card() : 0;
        if (items < 2 || static_cast<unsigned long>(format.frames) > items - 1) {
            return d.bad("PixelData", fmt::format("{} frames in {} fragments", format.frames, items ? items - 1 : 0),
                         "at least one fragment a frame", "the file is damaged; export it again");
        }
    } else {
        const double held = static_cast<double>(d.pixelData()->getLength(d.syntax));
        if (frame_bytes * format.frames > held) {
            return d.bad("PixelData",
                         fmt::format("{:.0f} bytes for {} frames of {} x {} pixels", held, format.frames, format.width,
                                     format.height),
                         fmt::format("{:.0f} bytes", frame_bytes * format.frames),
                         "the file is cut short or its header is wrong; export it again");
        }
    }
    return format;
}

Result<std::vector<std::uint8_t>> DicomFile::Impl::fragments(int frame, int frames) const {
    DcmPixelSequence* items = sequence();
    const Error damaged = bad("PixelData", "fragments that do not fit the frames", "undamaged pixel data",
                              "export it again, uncompressed");
    if (!items || items->card() < 2) return damaged;
    const unsigned long count = items->card() - 1;  // item 0 is the offset table
    const auto append = [&](unsigned long index, std::vector<std::uint8_t>& bytes) {
        DcmPixelItem* item = nullptr;
        Uint8* data = nullptr;
        if (items->getItem(item, index + 1).bad() || !item || item->getLength() > file_bytes) return false;
        if (item->getUint8Array(data).bad() || !data) return false;
        bytes.insert(bytes.end(), data, data + item->getLength());
        return true;
    };
    const auto startsFrame = [](const std::vector<std::uint8_t>& b) {  // JPEG 2000 bare and boxed, JPEG
        return b.size() > 8 &&
               ((b[0] == 0xFF && (b[1] == 0x4F || b[1] == 0xD8)) || std::memcmp(b.data() + 4, "jP  ", 4) == 0);
    };
    std::vector<std::uint8_t> result;
    if (static_cast<unsigned long>(frames) == count) {  // the usual case: one fragment a frame
        if (!append(static_cast<unsigned long>(frame), result)) return damaged;
        return result;
    }
    int current = -1;
    for (unsigned long i = 0; i < count; ++i) {  // a frame begins where a codestream begins
        std::vector<std::uint8_t> fragment;
        if (!append(i, fragment)) return damaged;
        if (startsFrame(fragment)) ++current;
        if (current == frame) result.insert(result.end(), fragment.begin(), fragment.end());
        if (current > frame) break;
    }
    if (result.empty()) return damaged;
    return result;
}

Result<std::vector<float>> DicomFile::Impl::jpeg2000Frame(const DicomPixelFormat& format, int index) const {
    const Result<std::vector<std::uint8_t>> codestream = fragments(index, format.frames);
    if (!codestream) return codestream.error();
    std::vector<std::int32_t> values;
    if (const auto error = decodeJpeg2000(*codestream, format.width, format.height, format.samples, values)) {
        return bad("PixelData", error->found,
                   fmt::format("{} x {} pixels of at most 16 bits", format.width, format.height),
                   "export it again, uncompressed");
    }
    std::vector<float> result(values.size());
    // Some writers code signed pixels as unsigned bit patterns: bring them back by the sign that DICOM declares.
    const std::int32_t wrap = 1 << format.bits_stored;
    for (std::size_t i = 0; i < values.size(); ++i) {
        std::int32_t value = values[i];
        if (format.is_signed && value >= wrap / 2) value -= wrap;
        if (!format.is_signed && value < 0) value += wrap;
        result[i] = static_cast<float>(value);
    }
    return result;
}

Result<std::vector<float>> DicomFile::frame(const DicomPixelFormat& format, int index) const {
    const Impl& d = *impl_;
    try {
        if (isJpeg2000(d.syntax)) return d.jpeg2000Frame(format, index);
        if (isJpeg(d.syntax)) {
            const Result<std::vector<std::uint8_t>> stream = d.fragments(index, format.frames);
            if (!stream) return stream.error();
            if (!jpegSizeIs(*stream, format.width, format.height)) {
                return d.bad("PixelData", "a JPEG picture of another size than Rows and Columns, or none",
                             fmt::format("{} x {} pixels", format.width, format.height),
                             "export it again, uncompressed");
            }
        }
        const std::size_t pixels = static_cast<std::size_t>(format.width) * static_cast<std::size_t>(format.height);
        const std::size_t count = pixels * static_cast<std::size_t>(format.samples);
        const std::size_t bytes = static_cast<std::size_t>(format.bits_allocated / 8);
        std::vector<std::uint8_t> octets((count * bytes + 1) / 2 * 2);  // DCMTK pads a frame to words
        const bool rle = d.syntax == EXS_RLELossless;
        OFString model(format.photometric.c_str());
        if (rle) {
            const Result<std::vector<std::uint8_t>> stream = d.fragments(index, format.frames);
            if (!stream) return stream.error();
            if (!decodeRle(*stream, pixels, static_cast<std::size_t>(format.samples), bytes, octets)) {
                return d.bad("PixelData", "damaged RLE data", "undamaged pixel data", "export it again, uncompressed");
            }
        } else {
            Uint32 fragment = 0;
            const OFCondition status =
                d.pixelData()->getUncompressedFrame(&d.dataset(), static_cast<Uint32>(index), fragment, octets.data(),
                                                    static_cast<Uint32>(octets.size()), model);
            if (status.bad()) {
                return d.bad("PixelData", fmt::format("frame {} that cannot be decoded ({})", index + 1, status.text()),
                             "undamaged pixel data", "export it again, uncompressed");
            }
        }
        if (format.samples == 3 && model != "RGB") {
            return d.bad("PhotometricInterpretation", printable(model.c_str()), "MONOCHROME1, MONOCHROME2 or RGB",
                         "export it as greyscale");
        }
        const int shift = format.high_bit + 1 - format.bits_stored;
        const int mask = (1 << format.bits_stored) - 1;
        const int sign = format.is_signed ? 1 << (format.bits_stored - 1) : 0;
        std::vector<float> values(count);
        for (std::size_t i = 0; i < count; ++i) {
            const int raw = bytes == 2 ? octets[2 * i] | octets[2 * i + 1] << 8 : octets[i];
            const int value = (raw >> shift) & mask;  // bits outside may hold overlays
            values[i] = static_cast<float>((value ^ sign) - sign);
        }
        const bool by_plane = format.planar && !rle && !isJpeg(d.syntax);
        if (format.samples == 3 && by_plane) {
            std::vector<float> interleaved(count);
            for (std::size_t i = 0; i < count; ++i)
                interleaved[3 * (i % pixels) + i / pixels] = values[i];
            values.swap(interleaved);
        }
        return values;
    } catch (const std::bad_alloc&) {
        return d.bad("PixelData", "pixel data that ask for more memory than there is", "undamaged pixel data");
    }
}

Result<std::optional<DicomLut>> DicomFile::modalityLut(const DicomPixelFormat& format) const {
    const Impl& d = *impl_;
    DcmItem* item = nullptr;
    if (d.dataset().findAndGetSequenceItem(DCM_ModalityLUTSequence, item, 0).bad() || !item) return {std::nullopt};
    const auto value = [&](unsigned long index) {
        Uint16 u = 0;
        Sint16 s = 0;
        if (item->findAndGetUint16(DCM_LUTDescriptor, u, index).good()) return static_cast<int>(u);
        if (item->findAndGetSint16(DCM_LUTDescriptor, s, index).good()) return static_cast<int>(s);
        return -1;
    };
    const Uint16* data = nullptr;
    unsigned long count = 0;
    if (item->findAndGetUint16Array(DCM_LUTData, data, &count).bad() || !data || count == 0) {
        return d.bad("ModalityLUTSequence", "no table", "LUTData");
    }
    const unsigned long entries = value(0) == 0 ? 65536 : static_cast<unsigned long>(std::max(value(0), 0));
    DicomLut lut;
    lut.first = value(1);
    if (format.is_signed && lut.first > 32767) lut.first -= 65536;
    const int bits = value(2);
    if (entries == 0 || !(bits == 8 || (bits > 8 && bits <= 16))) {
        return d.bad("ModalityLUTSequence", fmt::format("{} entries of {} bits", entries, bits), "8 to 16 bits");
    }
    if (count >= entries) {
        lut.values.assign(data, data + entries);
    } else if (bits == 8 && 2 * count >= entries) {  // two entries in a word
        for (unsigned long i = 0; i < entries; ++i) {
            lut.values.push_back(static_cast<float>((data[i / 2] >> (i % 2 ? 8 : 0)) & 0xFF));
        }
    } else {
        return d.bad("ModalityLUTSequence", fmt::format("{} of {} entries", count, entries), "all of them");
    }
    return {std::move(lut)};
}

}  // namespace fluorocut
