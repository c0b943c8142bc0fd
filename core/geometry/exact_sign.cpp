#include "core/geometry/exact_sign.h"

#include <array>
#include <cmath>

namespace fluorocut {
namespace {

struct TwoTerms {
    double value, error;  // value + error is exact, value is the rounded result
};

TwoTerms twoSum(double a, double b) {
    const double sum = a + b;
    const double b_part = sum - a;
    return {sum, (a - (sum - b_part)) + (b - b_part)};
}

TwoTerms twoProduct(double a, double b) {
    const double product = a * b;
    return {product, std::fma(a, b, -product)};
}

// A sum held exactly, as doubles that do not overlap, smallest first (Shewchuk's GROW-EXPANSION).
class ExactSum {
  public:
    void add(double term) {
        int kept = 0;
        for (int i = 0; i < count_; ++i) {
            const TwoTerms sum = twoSum(term, at(i));
            term = sum.value;
            if (sum.error != 0) at(kept++) = sum.error;
        }
        if (term != 0) at(kept++) = term;
        count_ = kept;
    }
    void add(const TwoTerms& terms) {
        add(terms.error);
        add(terms.value);
    }
    int sign() const {
        if (count_ == 0) return 0;
        return terms_[static_cast<std::size_t>(count_ - 1)] > 0 ? 1 : -1;
    }

  private:
    double& at(int i) { return terms_[static_cast<std::size_t>(i)]; }

    std::array<double, 24> terms_;  // as many as are added, at most: 6 triple products of 4 terms
    int count_ = 0;
};

}  // namespace

int exactTripleProductSign(const Vector3& a, const Vector3& b, const Vector3& c) {
    ExactSum sum;
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        for (const TwoTerms& minor : {twoProduct(b[j], c[k]), twoProduct(-b[k], c[j])}) {
            sum.add(twoProduct(minor.error, a[i]));
            sum.add(twoProduct(minor.value, a[i]));
        }
    }
    return sum.sign();
}

int exactProductDifferenceSign(double p, double q, double r, double s) {
    ExactSum sum;
    sum.add(twoProduct(p, q));
    sum.add(twoProduct(-r, s));
    return sum.sign();
}

}  // namespace fluorocut
