#include "core/fiducial/detection/bead_background.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "core/base/median.h"
#include "core/image/blur.h"

namespace fluorocut::detection {
namespace {

// A plane has 3 parameters, p and q some 60: accept them when they leave clearly less.
constexpr double kLatticeGain = 0.8;
constexpr int kRounds = 3;            // of robust weights
constexpr int kCrossedRounds = 6;     // of those, where c is fitted as well: p, q and c settle together
constexpr int kSweeps = 2;            // over the parts of a lattice, within one
constexpr double kLeastLevel = 0.05;  // of a lattice's intensity, by its plane's: no groove is this deep
// Of |c p| and |c q|: it is 1 in the middle of a groove.
constexpr double kMostInteraction = 1.5;

struct Sample {
    double x, y;  // from the bead's centre
    double value;
    double weight;
};

double robustSigma(const std::vector<double>& residuals) {
    std::vector<double> sizes;
    for (const double residual : residuals)
        sizes.push_back(std::abs(residual));
    return std::max(1.4826 * median(std::move(sizes)), 1e-6);
}

void reweight(std::vector<Sample>& samples, const std::vector<double>& residuals, double sigma) {
    for (std::size_t i = 0; i < samples.size(); ++i) {
        const double ratio = residuals[i] / (4 * sigma);
        samples[i].weight = 1 / ((1 + ratio * ratio) * (1 + ratio * ratio));
    }
}

Vector3 planeThrough(const std::vector<Sample>& samples, const std::vector<double>& values) {
    Matrix3 normal = Matrix3::Identity() * 1e-9;
    Vector3 right = Vector3::Zero();
    for (std::size_t i = 0; i < samples.size(); ++i) {
        const Vector3 row(1, samples[i].x, samples[i].y);
        normal += samples[i].weight * row * row.transpose();
        right += samples[i].weight * values[i] * row;
    }
    return normal.ldlt().solve(right);
}

// A function of one coordinate: straight between nodes one pixel apart.
class Ridge {
  public:
    explicit Ridge(double reach)
        : origin_(-std::ceil(reach) - 1), values_(static_cast<std::size_t>(-2 * origin_ + 3)) {}

    double at(double s) const {
        const auto [node, part] = placeOf(s);
        return (1 - part) * values_[node] + part * values_[node + 1];
    }
    double largest() const {
        double most = 0;
        for (const double value : values_)
            most = std::max(most, std::abs(value));
        return most;
    }
    void fit(const std::vector<Sample>& samples, const std::vector<double>& coordinate,
             const std::vector<double>& values) {
        std::vector<double> sums(values_.size(), 0.0), weights(values_.size(), 0.0);
        for (std::size_t i = 0; i < samples.size(); ++i) {
            const auto [node, part] = placeOf(coordinate[i]);
            sums[node] += samples[i].weight * (1 - part) * values[i];
            weights[node] += samples[i].weight * (1 - part);
            sums[node + 1] += samples[i].weight * part * values[i];
            weights[node + 1] += samples[i].weight * part;
        }
        // One pixel's worth of zero: a node that hardly anyone has seen stays near the plane.
        for (std::size_t i = 0; i < values_.size(); ++i)
            values_[i] = sums[i] / (weights[i] + 1);
    }
    // A step of least squares on what is left: samples at `coordinate` see this function times their gain. Correcting
    // what stands, not starting anew, leaves no smoothing of steep edges behind.
    void improve(const std::vector<Sample>& samples, const std::vector<double>& coordinate,
                 const std::vector<double>& gains, const std::vector<double>& residuals) {
        std::vector<double> sums(values_.size(), 0.0), weights(values_.size(), 0.0);
        for (std::size_t i = 0; i < samples.size(); ++i) {
            const auto [node, part] = placeOf(coordinate[i]);
            const double weight = samples[i].weight * gains[i];
            sums[node] += weight * (1 - part) * residuals[i];
            weights[node] += weight * gains[i] * (1 - part);
            sums[node + 1] += weight * part * residuals[i];
            weights[node + 1] += weight * gains[i] * part;
        }
        // One pixel's worth of zero: a node that hardly anyone has seen stays near the plane.
        for (std::size_t i = 0; i < values_.size(); ++i)
            values_[i] += (sums[i] - values_[i]) / (weights[i] + 1);
    }

  private:
    struct Place {
        std::size_t node;
        double part;
    };
    Place placeOf(double s) const {
        const double place = std::clamp(s - origin_, 0.0, static_cast<double>(values_.size()) - 1.001);
        const auto node = static_cast<std::size_t>(place);
        return {node, place - static_cast<double>(node)};
    }

    double origin_;
    std::vector<double> values_;
};

struct Lattice {
    Vector3 plane = Vector3::Zero();
    Ridge p{1}, q{1};
    double cosine = 1, sine = 0;

    double at(double x, double y) const {
        return plane.dot(Vector3(1, x, y)) + p.at(cosine * x + sine * y) + q.at(cosine * y - sine * x);
    }
};

Lattice fitLattice(const std::vector<Sample>& samples, const Vector3& plane, double angle, double reach) {
    Lattice lattice{plane, Ridge(reach), Ridge(reach), std::cos(angle), std::sin(angle)};
    std::vector<double> s(samples.size()), t(samples.size()), rest(samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i) {
        s[i] = lattice.cosine * samples[i].x + lattice.sine * samples[i].y;
        t[i] = lattice.cosine * samples[i].y - lattice.sine * samples[i].x;
    }
    for (int sweep = 0; sweep < 2; ++sweep) {
        for (std::size_t i = 0; i < samples.size(); ++i)
            rest[i] = samples[i].value - lattice.plane.dot(Vector3(1, samples[i].x, samples[i].y)) - lattice.q.at(t[i]);
        lattice.p.fit(samples, s, rest);
        for (std::size_t i = 0; i < samples.size(); ++i)
            rest[i] = samples[i].value - lattice.plane.dot(Vector3(1, samples[i].x, samples[i].y)) - lattice.p.at(s[i]);
        lattice.q.fit(samples, t, rest);
        for (std::size_t i = 0; i < samples.size(); ++i)
            rest[i] = samples[i].value - lattice.p.at(s[i]) - lattice.q.at(t[i]);
        lattice.plane = planeThrough(samples, rest);
    }
    return lattice;
}

// plane + p + q + c p q. A groove that is cut where another is already takes nothing more away: intensity has two
// levels, and the crossing's is that of the groove. With c = -1 / (step from land to groove) that is this model
// exactly, whatever the blur along the axes; c = 0 and 1 are grooves that add in intensity and in log intensity.
class CrossedLattice {
  public:
    CrossedLattice(double angle, double reach)
        : p_(reach), q_(reach), cosine_(std::cos(angle)), sine_(std::sin(angle)) {}

    double at(double x, double y) const {
        const double p = p_.at(cosine_ * x + sine_ * y), q = q_.at(cosine_ * y - sine_ * x);
        return plane_.dot(Vector3(1, x, y)) + p + q + interaction_ * p * q;
    }

    void improve(const std::vector<Sample>& samples) {
        std::vector<double> s(samples.size()), t(samples.size()), p(samples.size()), q(samples.size());
        std::vector<double> plane(samples.size()), gain(samples.size()), rest(samples.size());
        for (std::size_t i = 0; i < samples.size(); ++i) {
            s[i] = cosine_ * samples[i].x + sine_ * samples[i].y;
            t[i] = cosine_ * samples[i].y - sine_ * samples[i].x;
            p[i] = p_.at(s[i]);
            q[i] = q_.at(t[i]);
            plane[i] = plane_.dot(Vector3(1, samples[i].x, samples[i].y));
        }
        const auto improveRidge = [&](Ridge& own, const std::vector<double>& places, std::vector<double>& seen,
                                      const std::vector<double>& across) {
            for (std::size_t i = 0; i < samples.size(); ++i) {
                gain[i] = 1 + interaction_ * across[i];
                rest[i] = samples[i].value - plane[i] - across[i] - gain[i] * seen[i];
            }
            own.improve(samples, places, gain, rest);
            for (std::size_t i = 0; i < samples.size(); ++i)
                seen[i] = own.at(places[i]);
        };
        for (int sweep = 0; sweep < kSweeps; ++sweep) {
            improveRidge(p_, s, p, q);
            improveRidge(q_, t, q, p);
            for (std::size_t i = 0; i < samples.size(); ++i)
                rest[i] = samples[i].value - p[i] - q[i] - interaction_ * p[i] * q[i];
            plane_ = planeThrough(samples, rest);
            for (std::size_t i = 0; i < samples.size(); ++i)
                plane[i] = plane_.dot(Vector3(1, samples[i].x, samples[i].y));
            double sum = 0, weight = 1e-9;
            for (std::size_t i = 0; i < samples.size(); ++i) {
                const double product = p[i] * q[i];
                sum += samples[i].weight * product * (samples[i].value - plane[i] - p[i] - q[i]);
                weight += samples[i].weight * product * product;
            }
            const double most = kMostInteraction / std::max({p_.largest(), q_.largest(), 1e-3});
            interaction_ = std::clamp(sum / weight, -most, most);
        }
    }

  private:
    Vector3 plane_ = Vector3::UnitX();
    Ridge p_, q_;
    double interaction_ = 0;  // c
    double cosine_, sine_;
};

// What robust least squares with the weights of reweight() makes small (Geman and McClure).
double robustCost(const std::vector<double>& residuals, double sigma) {
    double sum = 0;
    for (const double residual : residuals) {
        const double ratio = residual / (4 * sigma);
        sum += residual * residual / (1 + ratio * ratio);
    }
    return sum;
}

}  // namespace

LatticeDirections::LatticeDirections(const Image& log_intensity)
    : columns_((log_intensity.width() + kCell - 1) / kCell),
      rows_((log_intensity.height() + kCell - 1) / kCell),
      cells_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)) {
    const Image smooth = gaussianBlurred(log_intensity, 1.2);
    for (int y = 1; y + 1 < smooth.height(); ++y) {
        for (int x = 1; x + 1 < smooth.width(); ++x) {
            const double gx = smooth(x + 1, y) - smooth(x - 1, y), gy = smooth(x, y + 1) - smooth(x, y - 1);
            const double squared = gx * gx + gy * gy;
            if (!(squared > 0)) continue;
            const std::complex<double> direction = std::complex<double>(gx, gy) / std::sqrt(squared);
            const std::complex<double> twice = direction * direction;
            // A bead's or a bone's edge is steeper than any groove's: it must not outvote them.
            cells_[static_cast<std::size_t>(y / kCell) * static_cast<std::size_t>(columns_) +
                   static_cast<std::size_t>(x / kCell)] += std::min(squared, 0.02) * twice * twice;
        }
    }
}

double LatticeDirections::angleAt(const Vector2& place_px) const {
    const int column = static_cast<int>(place_px.x()) / kCell, row = static_cast<int>(place_px.y()) / kCell;
    std::complex<double> sum = 0;
    for (int y = std::max(0, row - 3); y <= std::min(rows_ - 1, row + 3); ++y) {
        for (int x = std::max(0, column - 3); x <= std::min(columns_ - 1, column + 3); ++x)
            sum +=
                cells_[static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(x)];
    }
    return sum == 0.0 ? 0.0 : std::arg(sum) / 4;
}

BackgroundPatch backgroundAround(const Image& log_intensity, const LatticeDirections& directions, const Disk& bead,
                                 const std::vector<Disk>& others, int half_px, bool crossings) {
    BackgroundPatch patch;
    const int x0 = static_cast<int>(std::lround(bead.center_px.x())),
              y0 = static_cast<int>(std::lround(bead.center_px.y()));
    patch.left = std::max(0, x0 - half_px);
    patch.top = std::max(0, y0 - half_px);
    const int width = std::min(log_intensity.width(), x0 + half_px + 1) - patch.left;
    const int height = std::min(log_intensity.height(), y0 + half_px + 1) - patch.top;
    if (width < 3 || height < 3) return patch;
    patch.usable = Mask(width, height, 1);
    for (const Disk& other : others) {
        const double keep_off = 1.2 * other.radius_px + 1.5;
        for (int y = 0; y < height; ++y) {
            for (int x = 0; x < width; ++x) {
                if ((Vector2(patch.left + x, patch.top + y) - other.center_px).squaredNorm() < keep_off * keep_off)
                    patch.usable(x, y) = 0;
            }
        }
    }
    std::vector<Sample> samples;
    std::vector<bool> on_other;
    const double inside = 1.3 * bead.radius_px + 1.5;
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const Vector2 away = Vector2(patch.left + x, patch.top + y) - bead.center_px;
            if (!(away.norm() > inside)) continue;
            samples.push_back({away.x(), away.y(), log_intensity(patch.left + x, patch.top + y), 1});
            on_other.push_back(patch.usable(x, y) == 0);
        }
    }
    const auto hidden = std::count(on_other.begin(), on_other.end(), true);
    if (static_cast<std::ptrdiff_t>(samples.size()) - hidden < 12) return patch;

    // A plane, robustly: what lies off it by far (a bone's edge, a wire) loses its say.
    std::vector<double> residuals(samples.size());
    const auto at_plane = [](const Vector3& plane, const Sample& sample) {
        return plane.dot(Vector3(1, sample.x, sample.y));
    };
    std::vector<Sample> plain;
    for (std::size_t i = 0; i < samples.size(); ++i) {
        if (!on_other[i]) plain.push_back(samples[i]);
    }
    std::vector<double> values, plain_residuals(plain.size());
    for (const Sample& sample : plain)
        values.push_back(sample.value);
    Vector3 plane = Vector3::Zero();
    for (int round = 0; round < kRounds; ++round) {
        plane = planeThrough(plain, values);
        for (std::size_t i = 0; i < plain.size(); ++i)
            plain_residuals[i] = values[i] - at_plane(plane, plain[i]);
        patch.noise = robustSigma(plain_residuals);
        reweight(plain, plain_residuals, patch.noise);
    }

    // A lattice, with the neighbours: the dark squares between pale grooves are neighbours that belong to it, and what
    // does not fit loses its say.
    Lattice lattice = {};
    double lattice_noise = 0;
    for (int round = 0; round < kRounds; ++round) {
        lattice = fitLattice(samples, plane, directions.angleAt(bead.center_px), std::hypot(width, height));
        for (std::size_t i = 0; i < samples.size(); ++i)
            residuals[i] = samples[i].value - lattice.at(samples[i].x, samples[i].y);
        lattice_noise = robustSigma(residuals);
        reweight(samples, residuals, lattice_noise);
    }
    for (std::size_t i = 0; i < samples.size(); ++i)
        residuals[i] = samples[i].value - at_plane(plane, samples[i]);
    const double plane_noise = robustSigma(residuals);
    const double freedom = std::max(0.1, 1 - 2.0 * (width + height) / static_cast<double>(samples.size()));
    patch.lattice = lattice_noise * lattice_noise < kLatticeGain * freedom * plane_noise * plane_noise;
    if (patch.lattice) patch.noise = lattice_noise;

    patch.log_level = Image(width, height);
    int inner = 0;
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const double dx = patch.left + x - bead.center_px.x(), dy = patch.top + y - bead.center_px.y();
            patch.log_level(x, y) =
                static_cast<float>(patch.lattice ? lattice.at(dx, dy) : plane.dot(Vector3(1, dx, dy)));
            const double deficit = patch.log_level(x, y) - log_intensity(patch.left + x, patch.top + y);
            if (patch.lattice && std::abs(deficit) < 4 * patch.noise) patch.usable(x, y) = 1;
            if (dx * dx + dy * dy <= 0.36 * bead.radius_px * bead.radius_px + 0.5) {
                patch.contrast += deficit;
                ++inner;
            }
        }
    }
    patch.contrast /= std::max(1, inner);
    patch.valid = true;
    if (!crossings || !patch.lattice) return patch;

    // The same once more with crossings, from the start: what is far off where grooves only add, the crossings
    // themselves, has lost its say above. Without neighbours that are not of the lattice. In intensity, of the plane's.
    std::vector<Sample> seen;
    std::vector<double> added_residuals;
    for (const Sample& sample : samples) {
        const int x = static_cast<int>(std::lround(sample.x + bead.center_px.x())) - patch.left;
        const int y = static_cast<int>(std::lround(sample.y + bead.center_px.y())) - patch.top;
        if (patch.usable(x, y) == 0) continue;
        seen.push_back({sample.x, sample.y, std::exp(sample.value - at_plane(plane, sample)), 1});
        added_residuals.push_back(sample.value - lattice.at(sample.x, sample.y));
    }
    CrossedLattice crossed(directions.angleAt(bead.center_px), std::hypot(width, height));
    const auto crossedAt = [&](double x, double y) {
        return plane.dot(Vector3(1, x, y)) + std::log(std::max(crossed.at(x, y), kLeastLevel));
    };
    residuals.resize(seen.size());
    for (int round = 0; round < kCrossedRounds; ++round) {
        crossed.improve(seen);
        for (std::size_t i = 0; i < seen.size(); ++i)
            residuals[i] = seen[i].value - crossed.at(seen[i].x, seen[i].y);
        reweight(seen, residuals, robustSigma(residuals));
    }
    for (std::size_t i = 0; i < seen.size(); ++i) {
        const double value = std::log(seen[i].value) + at_plane(plane, seen[i]);
        residuals[i] = value - crossedAt(seen[i].x, seen[i].y);
    }
    const double crossed_noise = robustSigma(residuals);
    const double sigma = std::min(crossed_noise, lattice_noise);
    if (!(robustCost(residuals, sigma) < robustCost(added_residuals, sigma))) return patch;
    patch.noise = crossed_noise;
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            patch.log_level(x, y) =
                static_cast<float>(crossedAt(patch.left + x - bead.center_px.x(), patch.top + y - bead.center_px.y()));
        }
    }
    return patch;
}

}  // namespace fluorocut::detection
