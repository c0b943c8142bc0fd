// JPEG 2000 for DICOM, through OpenJPEG: Debian's DCMTK has no decoder for it.
#include <algorithm>
#include <cstring>
#include <memory>

#include <fmt/format.h>
#include <openjpeg.h>

#include "core/io/formats/dicom_file.h"

namespace fluorocut {

namespace {

struct Memory {
    const std::uint8_t* data;
    std::size_t size;
    std::size_t at = 0;
};

OPJ_SIZE_T readBytes(void* to, OPJ_SIZE_T count, void* user) {
    Memory& memory = *static_cast<Memory*>(user);
    const std::size_t got = std::min<std::size_t>(count, memory.size - memory.at);
    if (got == 0) return static_cast<OPJ_SIZE_T>(-1);  // the end
    std::memcpy(to, memory.data + memory.at, got);
    memory.at += got;
    return got;
}

OPJ_OFF_T skipBytes(OPJ_OFF_T count, void* user) {
    Memory& memory = *static_cast<Memory*>(user);
    if (count < 0) return -1;
    const std::size_t step = std::min<std::size_t>(static_cast<std::size_t>(count), memory.size - memory.at);
    memory.at += step;
    return static_cast<OPJ_OFF_T>(step);
}

OPJ_BOOL seekTo(OPJ_OFF_T position, void* user) {
    Memory& memory = *static_cast<Memory*>(user);
    if (position < 0 || static_cast<std::size_t>(position) > memory.size) return OPJ_FALSE;
    memory.at = static_cast<std::size_t>(position);
    return OPJ_TRUE;
}

void keepMessage(const char* message, void* user) {
    std::string& first = *static_cast<std::string*>(user);
    if (first.empty()) first = message;
    while (!first.empty() && (first.back() == '\n' || first.back() == '.'))
        first.pop_back();
}
void ignoreMessage(const char*, void*) {}

template <auto Destroy>
struct Destroyer {
    template <class T>
    void operator()(T* object) const {
        Destroy(object);
    }
};

}  // namespace

std::optional<Jpeg2000Error> decodeJpeg2000(const std::vector<std::uint8_t>& codestream, int width, int height,
                                            int samples, std::vector<std::int32_t>& values) {
    Memory memory{codestream.data(), codestream.size()};
    const bool boxed = codestream.size() > 8 && std::memcmp(codestream.data() + 4, "jP  ", 4) == 0;
    const std::unique_ptr<opj_codec_t, Destroyer<opj_destroy_codec>> codec(
        opj_create_decompress(boxed ? OPJ_CODEC_JP2 : OPJ_CODEC_J2K));
    const std::unique_ptr<opj_stream_t, Destroyer<opj_stream_destroy>> stream(
        opj_stream_create(std::max<std::size_t>(std::min<std::size_t>(codestream.size(), 1 << 20), 1024), OPJ_TRUE));
    if (!codec || !stream) throw std::bad_alloc();
    std::string message;
    opj_set_error_handler(codec.get(), keepMessage, &message);
    opj_set_warning_handler(codec.get(), ignoreMessage, nullptr);
    opj_set_info_handler(codec.get(), ignoreMessage, nullptr);
    opj_stream_set_user_data(stream.get(), &memory, nullptr);
    opj_stream_set_user_data_length(stream.get(), codestream.size());
    opj_stream_set_read_function(stream.get(), readBytes);
    opj_stream_set_skip_function(stream.get(), skipBytes);
    opj_stream_set_seek_function(stream.get(), seekTo);
    opj_dparameters_t parameters;
    opj_set_default_decoder_parameters(&parameters);
    const auto failed = [&] {
        return Jpeg2000Error{message.empty() ? "damaged JPEG 2000 data" : "damaged JPEG 2000 data (" + message + ")"};
    };
    if (!opj_setup_decoder(codec.get(), &parameters)) return failed();
    opj_decoder_set_strict_mode(codec.get(), OPJ_TRUE);  // data cut short is an error, not a grey corner
    opj_image_t* raw = nullptr;
    const bool header = opj_read_header(stream.get(), codec.get(), &raw);
    const std::unique_ptr<opj_image_t, Destroyer<opj_image_destroy>> image(raw);
    if (!header || !image) return failed();
    // Before anything of the declared size is allocated: it must be the size that DICOM declares.
    const auto agrees = [&](const opj_image_t& i) {
        if (i.numcomps != static_cast<OPJ_UINT32>(samples)) return false;
        if (i.x1 < i.x0 || i.y1 < i.y0 || i.x1 - i.x0 != static_cast<OPJ_UINT32>(width) ||
            i.y1 - i.y0 != static_cast<OPJ_UINT32>(height)) {
            return false;
        }
        for (OPJ_UINT32 c = 0; c < i.numcomps; ++c) {
            if (i.comps[c].dx != 1 || i.comps[c].dy != 1 || i.comps[c].prec > 16) return false;
        }
        return true;
    };
    if (!agrees(*image)) {
        return Jpeg2000Error{fmt::format("JPEG 2000 data of {} x {} pixels and {} components", image->x1 - image->x0,
                                         image->y1 - image->y0, image->numcomps)};
    }
    if (!opj_decode(codec.get(), stream.get(), image.get()) || !opj_end_decompress(codec.get(), stream.get())) {
        return failed();
    }
    const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    const std::size_t channels = static_cast<std::size_t>(samples);
    values.resize(pixels * channels);
    for (std::size_t c = 0; c < channels; ++c) {
        const opj_image_comp_t& component = image->comps[c];
        if (!component.data || component.w != static_cast<OPJ_UINT32>(width) ||
            component.h != static_cast<OPJ_UINT32>(height)) {
            return failed();
        }
        for (std::size_t i = 0; i < pixels; ++i)
            values[i * channels + c] = component.data[i];
    }
    return std::nullopt;
}

}  // namespace fluorocut
