// SHA-256 against the vectors of FIPS 180-4 and NIST's example files.
#include "core/casestore/sha256.h"

#include <gtest/gtest.h>

namespace fluorocut {
namespace {

TEST(Sha256, NistVectors) {
    EXPECT_EQ(sha256(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    EXPECT_EQ(sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    EXPECT_EQ(sha256("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
              "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
    EXPECT_EQ(sha256("abcdefghbcdefghicdefghijdefghijkefghijklfghijklmghijklmnhijklmnoijklmnopjklmnopqklmnopqrlmnopqrs"
                     "mnopqrstnopqrstu"),
              "cf5b16a778af8380036ce59e7b0492370b249b11e8f07a51afac45037afee9d1");
    EXPECT_EQ(sha256(std::string(1000000, 'a')), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
    // NIST SHA256ShortMsg.rsp: bytes above 127.
    EXPECT_EQ(sha256("\xd3"), "28969cdfa74a12c82f3bad960b0b000aca2ac329deea5c2328ebc6f2ba9802c1");
    EXPECT_EQ(sha256("\x11\xaf"), "5ca7133fa735326081558ac312c620eeca9970d1e70a4b95533d956f072d1f98");
}

// However it is cut into pieces: every length around one and two blocks, every place to cut.
TEST(Sha256, PiecesMakeTheWhole) {
    std::string text;
    for (int i = 0; i < 140; ++i)
        text += static_cast<char>(i * 37);
    for (std::size_t size = 0; size <= text.size(); ++size) {
        const std::string whole = sha256(std::string_view(text).substr(0, size));
        EXPECT_TRUE(isSha256(whole));
        for (std::size_t cut = 0; cut <= size; cut += 7) {
            Sha256 pieces;
            pieces.add(std::string_view(text).substr(0, cut));
            pieces.add(std::string_view(text).substr(cut, size - cut));
            EXPECT_EQ(pieces.finish(), whole) << size << ' ' << cut;
        }
    }
}

TEST(Sha256, FormOfADigest) {
    EXPECT_FALSE(isSha256(""));
    EXPECT_FALSE(isSha256(std::string(63, 'a')));
    EXPECT_FALSE(isSha256(std::string(64, 'A')));
    EXPECT_TRUE(isSha256(std::string(64, 'a')));
}

}  // namespace
}  // namespace fluorocut
