// DCMTK calls itself for every level of sequences within sequences, so a file of nothing else runs out of stack. Before
// it sees a file, we look how deep its items nest: at every even offset an item's tag opens a level, which closes where
// the item's length ends or, of undefined length, at the next delimiter. Both byte orders are looked for. Pixels may
// look like a tag by chance; a hundred of them nested do not.
#include <cstring>
#include <vector>

#include <fmt/format.h>

#include "core/io/formats/byte_reader.h"
#include "core/io/formats/dicom_file.h"

namespace fluorocut {

namespace {

constexpr std::size_t kMaxDepth = 100;  // real files: below ten
constexpr std::size_t kTagBytes = 8;    // tag and length

std::uint32_t word(const unsigned char* p, bool big) {
    return big ? (std::uint32_t{p[0]} << 24 | std::uint32_t{p[1]} << 16 | std::uint32_t{p[2]} << 8 | p[3])
               : (std::uint32_t{p[3]} << 24 | std::uint32_t{p[2]} << 16 | std::uint32_t{p[1]} << 8 | p[0]);
}

class NestingScan {
  public:
    // False as soon as it is too deep.
    bool at(const unsigned char* p, std::uint64_t offset) {
        const bool little = p[0] == 0xFE && p[1] == 0xFF && p[3] == 0xE0;
        const bool big = p[0] == 0xFF && p[1] == 0xFE && p[2] == 0xE0;
        if (!little && !big) return true;
        const unsigned char kind = little ? p[2] : p[3];
        constexpr std::uint64_t kUndefined = ~std::uint64_t{0};
        if (kind == 0x00) {
            while (!ends_.empty() && ends_.back() <= offset)
                ends_.pop_back();
            const std::uint32_t length = word(p + 4, big);
            ends_.push_back(length == 0xFFFFFFFF ? kUndefined : offset + kTagBytes + length);
            return ends_.size() <= kMaxDepth;
        }
        if (kind == 0x0D) {  // items of defined length end by themselves
            while (!ends_.empty() && ends_.back() != kUndefined)
                ends_.pop_back();
            if (!ends_.empty()) ends_.pop_back();
        }
        return true;
    }

  private:
    std::vector<std::uint64_t> ends_;
};

bool scan(ByteReader& reader) {
    NestingScan nesting;
    std::vector<unsigned char> buffer(1 << 20);
    std::size_t kept = 0;
    std::uint64_t offset = 0;  // of the buffer's beginning, always even
    for (;;) {
        const std::size_t got = reader.read(buffer.data() + kept, buffer.size() - kept);
        const std::size_t held = kept + got;
        std::size_t i = 0;
        for (; i + kTagBytes <= held; i += 2) {
            if (!nesting.at(buffer.data() + i, offset + i)) return false;
        }
        if (got == 0) return true;
        kept = held - i;
        std::memmove(buffer.data(), buffer.data() + i, kept);
        offset += i;
    }
}

}  // namespace

Result<void> checkDicomNesting(const std::filesystem::path& path) {
    const Error deep = invalidInput(path.string(), fmt::format("DICOM sequences nested deeper than {}", kMaxDepth),
                                    "a DICOM image", "the file is damaged or made to do harm");
    Result<ByteReader> plain = ByteReader::open(path, 0, ByteReader::Encoding::raw);
    if (!plain) return plain.error();
    if (!scan(*plain)) return deep;
    // A deflated data set follows the meta header, whose length stands in its first element.
    const Result<std::string> head = readBeginning(path, 1024);
    if (!head) return head.error();
    constexpr std::size_t kFirst = 132;
    if (head->size() < kFirst + 12 || head->compare(kFirst, 8, std::string_view("\2\0\0\0UL\4\0", 8)) != 0) return {};
    if (head->find("1.2.840.10008.1.2.1.99") == std::string::npos) return {};
    const std::uint32_t length = word(reinterpret_cast<const unsigned char*>(head->data()) + kFirst + 8, false);
    Result<ByteReader> inflated =
        ByteReader::open(path, kFirst + 12 + std::uint64_t{length}, ByteReader::Encoding::bareDeflate);
    if (!inflated) return inflated.error();
    if (!scan(*inflated)) return deep;
    return {};
}

}  // namespace fluorocut
