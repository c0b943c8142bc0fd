// Bytes of an input file, as they are or inflated (zlib or gzip), in pieces of the caller's choice; and the checks that
// every reader begins with: the file is there, is a file, may be read and is not empty.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <new>
#include <string>
#include <vector>

#include "core/base/result.h"

namespace fluorocut {

// The size of a regular, readable, non-empty file.
Result<std::uint64_t> inputFileSize(const std::filesystem::path& path);

// A whole file of at most `limit` bytes.
Result<std::string> readWholeFile(const std::filesystem::path& path, std::uint64_t limit);

// Up to `count` first bytes of a file.
Result<std::string> readBeginning(const std::filesystem::path& path, std::size_t count);

// No stream of zlib's makes more than 1032 bytes from one (its "Technical Details"): a header that declares more lies.
constexpr std::uint64_t kMaxInflation = 1032;

class ByteReader {
  public:
    enum class Encoding { raw, deflate, bareDeflate };  // bareDeflate: without zlib's or gzip's wrapping

    // Reads from `offset` on.
    static Result<ByteReader> open(const std::filesystem::path& path, std::uint64_t offset, Encoding encoding);

    // Reads `count` bytes, or as many as there are; `problem` tells why there were fewer.
    std::size_t read(void* to, std::size_t count);
    bool skip(std::uint64_t count);
    // At the end of compressed data: whether its check sum agrees (reads what is left of a stream that should be over).
    bool endsWell();
    const std::string& problem() const { return problem_; }

  private:
    struct Inflater;
    struct CloseFile {
        void operator()(std::FILE* file) const { std::fclose(file); }
    };
    struct EndInflate {
        void operator()(Inflater* inflater) const;
    };

    std::size_t inflateSome(void* to, std::size_t count);

    std::unique_ptr<std::FILE, CloseFile> file_;
    std::unique_ptr<Inflater, EndInflate> inflater_;
    std::string problem_ = "the end of the file";
};

// `read()`, or a sentence where it runs out of memory.
template <class Read>
auto withinMemory(const std::filesystem::path& path, const Read& read) -> decltype(read()) {
    try {
        return read();
    } catch (const std::bad_alloc&) {
        return invalidInput(path.string(), "content that needs more memory than there is", "a smaller file",
                            "close other programs, or crop or resample it");
    }
}

enum class DeflateWrapper { zlib, gzip };
std::string deflated(std::string_view bytes, DeflateWrapper wrapper);

}  // namespace fluorocut
