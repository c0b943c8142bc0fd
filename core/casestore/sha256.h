// SHA-256 (FIPS 180-4), by which the saved case names what it holds.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace fluorocut {

class Sha256 {
  public:
    void add(std::string_view bytes);
    // The digest of all that was added, as 64 lower-case hexadecimal digits. Asked for once, last.
    std::string finish();

  private:
    void addBlock(const unsigned char* block);

    std::array<std::uint32_t, 8> state_{0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                        0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
    std::array<unsigned char, 64> open_block_{};
    std::uint64_t size_ = 0;  // bytes
};

std::string sha256(std::string_view bytes);

// Has the form of a digest: 64 lower-case hexadecimal digits.
bool isSha256(std::string_view text);

}  // namespace fluorocut
