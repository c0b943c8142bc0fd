#include "core/fiducial/corkscrew_refinement/image_evidence.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace fluorocut::corkscrew {
namespace {

constexpr int kTilePx = 16;  // over which an error of the distortion map is one

// Correlated noise: what the fit's spread is, against what it would be if every pixel were on its own. The residuals'
// autocorrelation c(d) over the plane, weighted by how much the pixels pull together.
double varianceFactor(const Jacobian& jacobian, const Weighted& at, const Image& inverse_sigma, const Square& normal,
                      const PixelRegion& region) {
    constexpr int kReach = 5, kSide = 2 * kReach + 1;
    const Matrix6 covariance = normal.ldlt().solve(Square::Identity()).topLeftCorner<6, 6>();
    const Matrix6 whiten = Matrix6(covariance.llt().matrixU());  // U^T U = covariance: U J^T has unit spread
    Eigen::Matrix<double, kUnknowns, 6> project;
    {
        // Pose step = first rows of normal^-1 (J^T w r); whitened by covariance^-1/2.
        const Square inverse = normal.ldlt().solve(Square::Identity());
        project = (whiten.transpose().triangularView<Eigen::Lower>().solve(inverse.topRows<6>())).transpose();
    }
    const std::size_t count = jacobian.pixels.size();
    const int width = region.width;
    std::vector<std::int32_t> index(static_cast<std::size_t>(region.width) * static_cast<std::size_t>(region.height),
                                    -1);
    std::vector<float> pull(count * 6), e(count);
    for (std::size_t i = 0; i < count; ++i) {
        const std::uint32_t p = jacobian.pixels[i];
        index[p] = static_cast<std::int32_t>(i);
        const Eigen::Matrix<double, 1, kUnknowns> row =
            Eigen::Map<const Eigen::Matrix<float, 1, kUnknowns>>(jacobian.rows.data() + i * kUnknowns).cast<double>();
        const Eigen::Matrix<double, 1, 6> z = at.weights[i] * inverse_sigma.pixels()[p] * row * project;
        for (int k = 0; k < 6; ++k)
            pull[i * 6 + static_cast<std::size_t>(k)] = static_cast<float>(z[k]);
        e[i] = static_cast<float>(std::sqrt(at.weights[i]) * at.residuals[i]);
    }
    std::array<double, kSide * kSide> products{}, numbers{}, pulls{};
    for (std::size_t i = 0; i < count; ++i) {
        const int x = static_cast<int>(jacobian.pixels[i]) % width, y = static_cast<int>(jacobian.pixels[i]) / width;
        if (y % 4 != 0) continue;  // a quarter of them tells enough
        for (int dy = -kReach; dy <= kReach; ++dy) {
            if (y + dy < 0 || y + dy >= region.height) continue;
            for (int dx = -kReach; dx <= kReach; ++dx) {
                if (x + dx < 0 || x + dx >= width) continue;
                const std::int32_t j = index[static_cast<std::size_t>(y + dy) * static_cast<std::size_t>(width) +
                                             static_cast<std::size_t>(x + dx)];
                if (j < 0) continue;
                const auto lag = static_cast<std::size_t>((dy + kReach) * kSide + dx + kReach);
                const auto other = static_cast<std::size_t>(j);
                products[lag] += static_cast<double>(e[i]) * e[other];
                numbers[lag] += std::sqrt(at.weights[i] * at.weights[other]);
                double together = 0;
                for (std::size_t k = 0; k < 6; ++k)
                    together += static_cast<double>(pull[i * 6 + k]) * pull[other * 6 + k];
                pulls[lag] += together;
            }
        }
    }
    double factor = 0;
    for (std::size_t lag = 0; lag < products.size(); ++lag)
        if (numbers[lag] > 0) factor += products[lag] / numbers[lag] * pulls[lag];
    return 4 * factor / 6;
}

}  // namespace

PoseEvidence evidenceOf(const Linearisation& fit, const Rigid3& pose) {
    const std::size_t count = fit.jacobian.pixels.size();
    const auto shared = static_cast<Eigen::Index>(count > 0 ? fit.shared.size() / count : 0);
    // Unknowns first, then what is shared.
    using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    constexpr std::size_t kPiece = 2048;
    Eigen::MatrixXd across = Eigen::MatrixXd::Zero(kUnknowns, shared), own = Eigen::MatrixXd::Zero(shared, shared);
    Eigen::VectorXd pull = Eigen::VectorXd::Zero(shared);
    for (std::size_t first = 0; first < count; first += kPiece) {
        const auto rows = static_cast<Eigen::Index>(std::min(kPiece, count - first));
        Rows of_fit(rows, kUnknowns), of_shared(rows, shared);
        Eigen::VectorXf e(rows);
        for (Eigen::Index r = 0; r < rows; ++r) {
            const std::size_t i = first + static_cast<std::size_t>(r);
            const float root = static_cast<float>(std::sqrt(fit.at.weights[i]));
            const float factor = root * fit.inverse_sigma.pixels()[fit.jacobian.pixels[i]];
            of_fit.row(r) =
                factor * Eigen::Map<const Eigen::Matrix<float, 1, kUnknowns>>(fit.jacobian.rows.data() + i * kUnknowns);
            of_shared.row(r) = factor * Eigen::Map<const Eigen::Matrix<float, 1, Eigen::Dynamic>>(
                                            fit.shared.data() + i * static_cast<std::size_t>(shared), shared);
            e[r] = root * static_cast<float>(fit.at.residuals[i]);
        }
        across += (of_fit.transpose() * of_shared).cast<double>();
        own += (of_shared.transpose() * of_shared).cast<double>();
        pull += (of_shared.transpose() * e).cast<double>();
    }
    const Eigen::Index all = 6 + shared;
    Eigen::MatrixXd kept(all, all), to_followers(all, kFollowers);
    kept.topLeftCorner<6, 6>() = fit.normal.topLeftCorner<6, 6>();
    kept.topRightCorner(6, shared) = across.topRows<6>();
    kept.bottomLeftCorner(shared, 6) = across.topRows<6>().transpose();
    kept.bottomRightCorner(shared, shared) = own;
    to_followers.topRows<6>() = fit.normal.topRightCorner<6, kFollowers>();
    to_followers.bottomRows(shared) = across.bottomRows<kFollowers>().transpose();
    Eigen::VectorXd gradient(all);
    gradient << -fit.right.head<6>(), -pull;

    using FollowerSquare = Eigen::Matrix<double, kFollowers, kFollowers>;
    const FollowerSquare of_followers = fit.normal.bottomRightCorner<kFollowers, kFollowers>();
    const Eigen::LDLT<FollowerSquare> solver(of_followers);
    const Eigen::Matrix<double, kFollowers, 1> follower_gradient = -fit.right.tail<kFollowers>();
    kept -= to_followers * solver.solve(to_followers.transpose());
    gradient -= to_followers * solver.solve(follower_gradient);

    const double factor = varianceFactor(fit.jacobian, fit.at, fit.inverse_sigma, fit.normal, fit.region);
    PoseEvidence evidence;
    evidence.target_from_source = pose;
    evidence.shared = Eigen::VectorXd::Zero(shared);
    evidence.information = 0.5 / factor * (kept + kept.transpose());
    evidence.gradient = gradient / factor;
    return evidence;
}

Matrix6 distortionGain(const Linearisation& fit, double length_mm) {
    // Pose step of a shift of the image by one mm, tile by tile.
    struct Tile {
        Vector2 middle_mm = Vector2::Zero();
        double pixels = 0;
        Eigen::Matrix<double, kUnknowns, 2> pull = Eigen::Matrix<double, kUnknowns, 2>::Zero();
    };
    const int columns = (fit.region.width + kTilePx - 1) / kTilePx, rows = (fit.region.height + kTilePx - 1) / kTilePx;
    std::vector<Tile> tiles(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
    for (std::size_t i = 0; i < fit.jacobian.pixels.size(); ++i) {
        const std::uint32_t p = fit.jacobian.pixels[i];
        const int x = static_cast<int>(p) % fit.region.width, y = static_cast<int>(p) / fit.region.width;
        Tile& tile = tiles[static_cast<std::size_t>(y / kTilePx * columns + x / kTilePx)];
        const double sigma = fit.inverse_sigma.pixels()[p], weight = fit.at.weights[i] * sigma * sigma;
        const Row row = Eigen::Map<const Eigen::Matrix<float, kUnknowns, 1>>(fit.jacobian.rows.data() + i * kUnknowns)
                            .cast<double>();
        const Vector2 slope(fit.gradient[0].pixels()[p], fit.gradient[1].pixels()[p]);
        tile.pull += weight * row * slope.cwiseQuotient(fit.pixel_mm).transpose();
        tile.middle_mm += Vector2(x, y).cwiseProduct(fit.pixel_mm);
        ++tile.pixels;
    }
    std::erase_if(tiles, [](const Tile& tile) { return tile.pixels == 0; });
    const Square inverse = fit.normal.ldlt().solve(Square::Identity());
    std::vector<Eigen::Matrix<double, 6, 2>> gains;
    for (Tile& tile : tiles) {
        tile.middle_mm /= tile.pixels;
        gains.push_back(inverse.topRows<6>() * tile.pull);
    }
    Matrix6 covariance = Matrix6::Zero();
    for (std::size_t a = 0; a < tiles.size(); ++a) {
        covariance += gains[a] * gains[a].transpose();
        for (std::size_t b = 0; b < a; ++b) {
            const double apart = (tiles[a].middle_mm - tiles[b].middle_mm).squaredNorm() / (length_mm * length_mm);
            if (apart > 60) continue;
            const Matrix6 product = std::exp(-0.5 * apart) * gains[a] * gains[b].transpose();
            covariance += product + product.transpose();
        }
    }
    return covariance;
}

}  // namespace fluorocut::corkscrew
