#include "core/io/formats/byte_reader.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include <fmt/format.h>
#include <zlib.h>

namespace fluorocut {

namespace fs = std::filesystem;

Result<std::uint64_t> inputFileSize(const fs::path& path) {
    std::error_code code;
    const fs::file_status status = fs::status(path, code);
    if (!fs::exists(status)) {
        return invalidInput(path.string(),
                            code && code != std::errc::no_such_file_or_directory ? code.message() : "no such file",
                            "a file", "check the path");
    }
    if (fs::is_directory(status)) return invalidInput(path.string(), "a folder", "a file");
    if (!fs::is_regular_file(status)) return invalidInput(path.string(), "a device or pipe", "a regular file");
    const std::uint64_t size = fs::file_size(path, code);
    if (code) return invalidInput(path.string(), code.message(), "a readable file");
    if (size == 0) return invalidInput(path.string(), "an empty file", "content", "export or copy it again");
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), std::fclose);
    if (!file) return invalidInput(path.string(), std::strerror(errno), "a readable file", "check its permissions");
    return size;
}

Result<std::string> readBeginning(const fs::path& path, std::size_t count) {
    const Result<std::uint64_t> size = inputFileSize(path);
    if (!size) return size.error();
    Result<ByteReader> reader = ByteReader::open(path, 0, ByteReader::Encoding::raw);
    if (!reader) return reader.error();
    std::string content(static_cast<std::size_t>(std::min<std::uint64_t>(*size, count)), '\0');
    content.resize(reader->read(content.data(), content.size()));
    return content;
}

Result<std::string> readWholeFile(const fs::path& path, std::uint64_t limit) {
    const Result<std::uint64_t> size = inputFileSize(path);
    if (!size) return size.error();
    if (*size > limit) {
        return invalidInput(path.string(), fmt::format("{} bytes", *size), fmt::format("at most {}", limit));
    }
    return readBeginning(path, static_cast<std::size_t>(*size));
}

struct ByteReader::Inflater {
    z_stream stream{};
    std::vector<unsigned char> input = std::vector<unsigned char>(1 << 16);
    bool ended = false;
};

void ByteReader::EndInflate::operator()(Inflater* inflater) const {
    inflateEnd(&inflater->stream);
    delete inflater;
}

Result<ByteReader> ByteReader::open(const fs::path& path, std::uint64_t offset, Encoding encoding) {
    if (const Result<std::uint64_t> size = inputFileSize(path); !size) return size.error();
    ByteReader reader;
    reader.file_.reset(std::fopen(path.c_str(), "rb"));
    if (!reader.file_ || ::fseeko(reader.file_.get(), static_cast<off_t>(offset), SEEK_SET) != 0) {
        return invalidInput(path.string(), std::strerror(errno), "a readable file");
    }
    if (encoding != Encoding::raw) {
        auto inflater = std::make_unique<Inflater>();
        // 15 bits of window; + 32: zlib and gzip headers are both recognised; negative: there is none
        if (inflateInit2(&inflater->stream, encoding == Encoding::deflate ? 15 + 32 : -15) != Z_OK)
            throw std::bad_alloc();
        reader.inflater_.reset(inflater.release());
    }
    return reader;
}

std::size_t ByteReader::inflateSome(void* to, std::size_t count) {
    z_stream& stream = inflater_->stream;
    stream.next_out = static_cast<Bytef*>(to);
    stream.avail_out = static_cast<uInt>(count);
    while (stream.avail_out > 0) {
        if (stream.avail_in == 0) {
            stream.next_in = inflater_->input.data();
            stream.avail_in =
                static_cast<uInt>(std::fread(inflater_->input.data(), 1, inflater_->input.size(), file_.get()));
            if (stream.avail_in == 0) break;
        }
        if (inflater_->ended) {  // gzip files may be several streams one after the other
            if (inflateReset(&stream) != Z_OK) break;
            inflater_->ended = false;
        }
        const int status = inflate(&stream, Z_NO_FLUSH);
        if (status == Z_STREAM_END) {
            inflater_->ended = true;
        } else if (status != Z_OK) {
            problem_ = fmt::format("broken compressed data ({})", stream.msg ? stream.msg : "zlib gives up");
            break;
        }
    }
    return count - stream.avail_out;
}

std::size_t ByteReader::read(void* to, std::size_t count) {
    if (!inflater_) return std::fread(to, 1, count, file_.get());
    std::size_t done = 0;
    while (done < count) {
        const std::size_t piece = std::min<std::size_t>(count - done, 1u << 30);  // zlib counts in 32 bits
        const std::size_t got = inflateSome(static_cast<char*>(to) + done, piece);
        done += got;
        if (got < piece) break;
    }
    return done;
}

bool ByteReader::skip(std::uint64_t count) {
    if (!inflater_) return ::fseeko(file_.get(), static_cast<off_t>(count), SEEK_CUR) == 0;
    std::vector<char> scrap(1 << 16);
    while (count > 0) {
        const std::size_t piece = static_cast<std::size_t>(std::min<std::uint64_t>(count, scrap.size()));
        if (read(scrap.data(), piece) < piece) return false;
        count -= piece;
    }
    return true;
}

bool ByteReader::endsWell() {
    if (!inflater_ || inflater_->ended) return true;
    char extra = 0;
    // The check sum follows the data and is looked at when the stream is asked for more.
    if (inflateSome(&extra, 1) == 1) return true;  // more data than was declared: the header's reader decides
    return inflater_->ended;
}

std::string deflated(std::string_view bytes, DeflateWrapper wrapper) {
    z_stream stream{};
    // Level 3: on CT data a third of the default's time for a few per cent more bytes.
    const int window = 15 + (wrapper == DeflateWrapper::gzip ? 16 : 0);
    if (deflateInit2(&stream, 3, Z_DEFLATED, window, 8, Z_DEFAULT_STRATEGY) != Z_OK) throw std::bad_alloc();
    std::string result;
    std::vector<char> piece(1 << 18);
    int status = Z_OK;
    do {
        if (stream.avail_in == 0 && !bytes.empty()) {
            const std::size_t count = std::min<std::size_t>(bytes.size(), 1u << 30);
            // zlib reads through this pointer only; its interface predates const
            stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
            stream.avail_in = static_cast<uInt>(count);
            bytes.remove_prefix(count);
        }
        stream.next_out = reinterpret_cast<Bytef*>(piece.data());
        stream.avail_out = static_cast<uInt>(piece.size());
        status = deflate(&stream, bytes.empty() ? Z_FINISH : Z_NO_FLUSH);
        result.append(piece.data(), piece.size() - stream.avail_out);
    } while (status == Z_OK);
    deflateEnd(&stream);
    if (status != Z_STREAM_END) throw std::logic_error("deflate did not end");
    return result;
}

}  // namespace fluorocut
